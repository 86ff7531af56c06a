/* carom_impact: impacts of a robot, for GNU Octave and MATLAB. `help carom_impact` shows carom_impact.m.
 *
 * Built by: mkoctfile --mex carom_impact.c -lcarom_c (in MATLAB: mex carom_impact.c -lcarom_c), with the folders of header and library. */
#include <carom.h>
#include <mex.h>
#include <string.h>

/* What a call holds: freed before an error ends it. */
static carom_chain *chain;
static carom_law *law;
static carom_strike *strike;
static carom_hit *hits;
static char *urdf, *frame, *law_name;

static void release(void) {
    carom_strike_free(strike);
    carom_law_free(law);
    carom_chain_free(chain);
    mxFree(hits);
    mxFree(urdf);
    mxFree(frame);
    mxFree(law_name);
    strike = NULL;
    law = NULL;
    chain = NULL;
    hits = NULL;
    urdf = frame = law_name = NULL;
}

static void check(carom_status status) {
    if (status != CAROM_OK) {
        /* mexErrMsgIdAndTxt does not return, and the message belongs to the last call. */
        char message[2048];
        strncpy(message, carom_error(), sizeof message - 1);
        message[sizeof message - 1] = 0;
        release();
        mexErrMsgIdAndTxt("carom:refused", "%s", message);
    }
}

static void refuse(const char *message) {
    release();
    mexErrMsgIdAndTxt("carom:argument", "%s", message);
}

static const double *numbers(const mxArray *given, const char *message) {
    if (!mxIsDouble(given) || mxIsComplex(given) || mxIsSparse(given)) {
        refuse(message);
    }
    return mxGetPr(given);
}

static char *text(const mxArray *given, const char *message) {
    if (!mxIsChar(given)) {
        refuse(message);
    }
    return mxArrayToString(given);
}

static mxArray *field(mxArray *result, const char *name, size_t rows, size_t columns) {
    mxArray *values = mxCreateDoubleMatrix(rows, columns, mxREAL);
    mxSetField(result, 0, name, values);
    return values;
}

void mexFunction(int outputs, mxArray *out[], int inputs, const mxArray *in[]) {
    static const char *names[] = {"qd_plus", "impulse", "u_minus", "u_plus", "energy_before", "energy_after", "normal_work", "friction_work", "mode", "flags"};
    static const char *modes[] = {"open", "stick", "slip", "reverse-slip"};
    (void)outputs;
    /* What a call that has not returned has left: texts and arrays belong to the interpreter, which has freed them. */
    hits = NULL;
    urdf = frame = law_name = NULL;
    release();
    if (inputs != 7 && inputs != 8) {
        refuse("carom_impact needs urdf, frame, normal, law, coefficients, q, qd and, if wanted, point: help carom_impact");
    }
    urdf = text(in[0], "carom_impact: urdf is no text: give the path of a URDF file");
    frame = text(in[1], "carom_impact: frame is no text: give the name of a link");
    const double *normal = numbers(in[2], "carom_impact: normal: give three real numbers");
    law_name = text(in[3], "carom_impact: law is no text: give a name such as 'energetic'");
    const double *coefficients = numbers(in[4], "carom_impact: coefficients: give [restitution friction] or [restitution friction tangential]");
    const double *q = numbers(in[5], "carom_impact: q: give real numbers, a column for each state");
    const double *qd = numbers(in[6], "carom_impact: qd: give real numbers, a column for each state");
    double point[3] = {0, 0, 0};
    if (mxGetNumberOfElements(in[2]) != 3) {
        refuse("carom_impact: normal: give three real numbers");
    }
    const size_t given = mxGetNumberOfElements(in[4]);
    if (given < 1 || given > 3) {
        refuse("carom_impact: coefficients: give [restitution friction] or [restitution friction tangential]");
    }
    if (inputs == 8) {
        const double *offset = numbers(in[7], "carom_impact: point: give three real numbers");
        if (mxGetNumberOfElements(in[7]) != 3) {
            refuse("carom_impact: point: give three real numbers");
        }
        memcpy(point, offset, sizeof point);
    }

    size_t tip;
    check(carom_chain_load(urdf, 0, &chain));
    check(carom_chain_frame(chain, frame, &tip));
    check(carom_law_create(law_name, coefficients[0], given > 1 ? coefficients[1] : 0, given > 2 ? coefficients[2] : 0, &law));
    check(carom_strike_prepare(chain, tip, point, normal, NULL, &strike));

    /* A vector is one state, whichever way it lies; the columns of a matrix are states. */
    const size_t nv = carom_chain_nv(chain), nq = carom_chain_nq(chain);
    const size_t count = mxGetNumberOfElements(in[5]) == nq ? 1 : mxGetN(in[5]);
    out[0] = mxCreateStructMatrix(1, 1, sizeof names / sizeof *names, names);
    mxArray *qd_plus = field(out[0], "qd_plus", nv, count);
    hits = mxCalloc(count > 0 ? count : 1, sizeof *hits);
    const carom_status status = carom_strike_many(strike, law, count, q, mxGetNumberOfElements(in[5]), qd, mxGetNumberOfElements(in[6]),
                                                  mxGetPr(qd_plus), nv * count, hits);
    if (status == CAROM_REFUSED_PHYSICS && count > 1) {
        mexWarnMsgIdAndTxt("carom:refused", "%s; the numbers of such states are NaN", carom_error());
    } else {
        check(status);
    }

    double *impulse = mxGetPr(field(out[0], "impulse", 3, count)), *u_minus = mxGetPr(field(out[0], "u_minus", 3, count));
    double *u_plus = mxGetPr(field(out[0], "u_plus", 3, count)), *before = mxGetPr(field(out[0], "energy_before", 1, count));
    double *after = mxGetPr(field(out[0], "energy_after", 1, count)), *normal_work = mxGetPr(field(out[0], "normal_work", 1, count));
    double *friction_work = mxGetPr(field(out[0], "friction_work", 1, count)), *flags = mxGetPr(field(out[0], "flags", 1, count));
    mxArray *mode = mxCreateCellMatrix(1, count);
    mxSetField(out[0], 0, "mode", mode);
    for (size_t k = 0; k < count; k++) {
        memcpy(impulse + 3 * k, hits[k].impulse, sizeof hits[k].impulse);
        memcpy(u_minus + 3 * k, hits[k].u_minus, sizeof hits[k].u_minus);
        memcpy(u_plus + 3 * k, hits[k].u_plus, sizeof hits[k].u_plus);
        before[k] = hits[k].energy_before;
        after[k] = hits[k].energy_after;
        normal_work[k] = hits[k].normal_work;
        friction_work[k] = hits[k].friction_work;
        flags[k] = hits[k].flags;
        mxSetCell(mode, k, mxCreateString(modes[hits[k].mode]));
    }
    release();
}
