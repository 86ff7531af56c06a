"""Checks the judge with the closed form of a ball, right and with planted defects: check.py. Exit status 1 if a verdict is unexpected."""

import os
import sys

import judge

# What the judge must say of the example adapter with each defect: case → verdict.
EXPECTED = {
    "": {"ball-e": "exact", "speed": "exact", "zeno": "exact", "step": "exact", "gradient-height": "exact", "arm-wall": "refused", "cradle": "refused"},
    "restitution": {"ball-e": "fails", "speed": "fails", "zeno": "fails", "step": "fails", "gradient-height": "fails"},
    "threshold": {"ball-e": "exact", "speed": "fails"},
    "late": {"ball-e": "exact", "zeno": "within tolerance", "step": "degrades"},
}


def main():
    here = os.path.dirname(os.path.abspath(__file__))
    wrong = 0
    for defect, verdicts in EXPECTED.items():
        os.environ["DEFECT"] = defect
        adapter = judge.Adapter([sys.executable, os.path.join(here, "example_adapter.py")])
        for case in judge.cases(list(verdicts)):
            found = judge.judge(case, adapter, "best")
            right = found["verdict"] == verdicts[case["case"]]
            wrong += not right
            print(f"{'ok   ' if right else 'WRONG'} defect {defect or 'none':12} {judge.told(dict(found, engine='example'))}")
        adapter.close()
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
