"""Xacro files are expanded by the package `xacro`, with its own `$(find …)`; what goes wrong is named."""

import pickle
import sys
import types

import pytest

import carom

pytest.importorskip("xacro")

ARM = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="prefix" default=""/>
  <xacro:arg name="long" default="false"/>
  <xacro:include filename="$(find parts)/urdf/rod.xacro"/>
  <xacro:property name="length" value="${2.0 if '$(arg long)' == 'true' else 1.0}"/>
  <link name="base"/>
  <xacro:rod name="$(arg prefix)upper" parent="base" length="${length}"/>
</robot>"""
ROD = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="rod" params="name parent length">
    <link name="${name}"><inertial><origin xyz="${length / 2} 0 0"/><mass value="3"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="${length ** 2 / 4}" iyz="0" izz="${length ** 2 / 4}"/></inertial>
      <collision><geometry><mesh filename="package://parts/rod.stl"/></geometry></collision></link>
    <joint name="${name}_joint" type="continuous"><parent link="${parent}"/><child link="${name}"/><axis xyz="0 0 1"/></joint>
  </xacro:macro>
</robot>"""
SOLID = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"


@pytest.fixture
def arm(tmp_path):
    """A workspace of two packages, of which one has another name than its folder."""
    for file, text in {
        "src/robot/urdf/arm.urdf.xacro": ARM,
        "src/robot/package.xml": "<package><name>robot</name></package>",
        "src/parts_v2/urdf/rod.xacro": ROD,
        "src/parts_v2/rod.stl": SOLID,
        "src/parts_v2/package.xml": "<package><name>parts</name></package>",
    }.items():
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "src/robot/urdf/arm.urdf.xacro"


def read(arm, **more):
    return carom.Chain.from_urdf(arm, package_dirs=[arm.parents[2]], **more)


def test_a_xacro_file_is_read_with_its_arguments_and_packages(arm):
    short, long = read(arm), read(arm, xacro={"prefix": "left_", "long": True})
    assert (short.name, short.frames, long.name, long.frames) == ("arm", ["base", "upper"], "arm", ["base", "left_upper"])
    # M = l²/4 + m (l/2)².
    assert [chain.mass_matrix([0.3])[0, 0] for chain in (short, long)] == [0.25 + 0.75, 1 + 3]
    assert short.warnings == []
    again = pickle.loads(pickle.dumps(long))
    assert (again.frames, again.mass_matrix([0.0])[0, 0]) == (["base", "left_upper"], 4)
    assert "ament_index_python" not in sys.modules


def test_ros_finds_the_packages_by_its_environment(arm, monkeypatch):
    with pytest.raises(carom.UrdfError, match="there is no package 'parts' in or above"):
        carom.Chain.from_urdf(arm)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(arm.parents[2]))
    assert carom.Chain.from_urdf(arm).warnings == []
    # The install folder of a ROS 2 workspace, as its setup script names it.
    share = arm.parents[3] / "install/parts/share/parts"
    share.mkdir(parents=True)
    arm.parents[2].joinpath("parts_v2").rename(share / "old")
    for entry in list((share / "old").iterdir()):
        entry.rename(share / entry.name)
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{share.parents[1]}")
    assert carom.Chain.from_urdf(arm).warnings == []


def test_what_is_wrong_with_a_xacro_file_is_named(arm, monkeypatch):
    with pytest.raises(carom.UrdfError, match=r"arm\.urdf\.xacro: the file has no argument prefx; its arguments: long, prefix"):
        read(arm, xacro={"prefx": "a"})
    broken = arm.with_name("broken.xacro")
    broken.write_text(ARM.replace("${length}", "${width}"))
    with pytest.raises(carom.UrdfError, match=r"broken\.xacro: xacro refuses the file: .*width.*in file: .*broken\.xacro"):
        read(broken)
    broken.write_text(ARM.replace('type="continuous"', 'type="coil"'))
    broken.write_text(ARM.replace('name="base"/>', 'name="base"/><joint name="j" type="coil"/>'))
    with pytest.raises(carom.UrdfError, match=r"broken\.xacro, expanded by xacro:\d+: joint 'j'"):
        read(broken)
    with pytest.raises(TypeError, match="give the path of a file"):
        carom.Chain.from_urdf(ARM, xacro={})
    with pytest.raises(carom.UrdfError, match="pip install xacro` and `xacro FILE.xacro -o FILE.urdf`"):
        carom.Chain.from_urdf(ARM)
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(carom.UrdfError, match="pip install xacro"):
        read(arm)


def test_robot_descriptions_may_be_xacro(arm, monkeypatch):
    package, module = types.ModuleType("robot_descriptions"), types.ModuleType("robot_descriptions.arm_description")
    package.__path__ = []
    module.XACRO_PATH, module.XACRO_ARGS, module.PACKAGE_PATH = str(arm), {"prefix": "a_"}, str(arm.parents[2])
    monkeypatch.setitem(sys.modules, "robot_descriptions", package)
    monkeypatch.setitem(sys.modules, "robot_descriptions.arm_description", module)
    assert carom.Chain.from_robot_description("arm_description").frames == ["base", "a_upper"]
