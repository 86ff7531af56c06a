/* A scene from event to event with a controller in the loop, then as a whole. Usage: scene SCENE.toml */
#include <carom.h>
#include <stdio.h>
#include <stdlib.h>

static void check(carom_status status) {
    if (status != CAROM_OK) {
        fprintf(stderr, "error: %s\n", carom_error());
        exit(1);
    }
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: %s SCENE.toml\n", argv[0]);
        return 2;
    }
    carom_scene *scene;
    carom_session *session;
    carom_chain *robot;
    check(carom_scene_load(argv[1], &scene));
    fprintf(stderr, "%s", carom_scene_warnings(scene));
    check(carom_session_start(scene, &session));
    check(carom_session_chain(session, &robot));
    const size_t nq = carom_chain_nq(robot), nv = carom_chain_nv(robot);
    double *q = malloc(nq * sizeof *q), *qd = malloc(nv * sizeof *qd), *forces = malloc(nv * sizeof *forces);
    double time = 0;

    /* A brake on every joint, sampled at 100 Hz. */
    for (int step = 0; step < 50; step++) {
        size_t events;
        check(carom_session_state(session, &time, q, nq, qd, nv));
        for (size_t k = 0; k < nv; k++) {
            forces[k] = -2 * qd[k];
        }
        check(carom_session_set_forces(session, forces, nv));
        check(carom_session_advance(session, 0.01, &events));
        for (size_t k = 0; k < events; k++) {
            carom_event event;
            check(carom_session_event(session, k, &event));
            const double *p = event.impulse;
            printf("%.6f s  %s  %s  (%.6g, %.6g, %.6g) N s\n", event.time, event.kind, event.contact, p[0], p[1], p[2]);
        }
    }

    /* The whole run with the scene's own controller, as `carom simulate --json` prints it. */
    char *json, *warnings;
    check(carom_scene_summary_json(scene, &json, &warnings));
    fprintf(stderr, "%s", warnings);
    printf("%s\n", json);
    carom_text_free(json);
    carom_text_free(warnings);

    free(q);
    free(qd);
    free(forces);
    carom_chain_free(robot);
    carom_session_free(session);
    carom_scene_free(scene);
    return 0;
}
