/** The C API of carom: impacts of kinematic chains, qd+ = qd- + M^-1 J^T p.
 *
 * Generated from the sources of the crate carom-c: do not edit. The page "Use carom from C and C++" of the book shows its use.
 *
 * Conventions. SI units and radians. q and qd list the joints in the order of the URDF file, an added floating base first. Vectors
 * and matrices of points are in world axes. Matrices are stored row by row; the states of a batch are rows. A contact normal points
 * from the environment to the robot, an approach has a negative normal velocity, impulses and forces are those on the robot.
 *
 * Errors. Functions return a carom_status; after any but CAROM_OK, carom_error() is the message. Each array comes with its length,
 * which is checked. A panic of the library becomes CAROM_PANIC, with a message on standard error.
 *
 * Memory. The caller frees the handles and texts that are written to a pointer to a pointer; after a fault NULL is written there.
 * Texts that are returned belong to the library. Memory that is written to may be uninitialised. It must not overlap any other
 * argument: that is refused, as are NULL, wrong lengths and misaligned addresses. A dangling pointer is undefined behaviour.
 *
 * Threads. Chains, laws and scenes do not change: any number of threads may use one at the same time. Dynamics, strikes and
 * sessions hold memory: one thread at a time uses one, each thread makes its own. A handle may move from thread to thread. Nothing
 * is freed while another thread uses it.
 */

#ifndef CAROM_H
#define CAROM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/**
 * For carom_chain_load: connects the root link to the world by a floating joint.
 */
#define CAROM_FLOATING_BASE 1

/**
 * For carom_chain_load: changes a robot without sound dynamics as little as these need; the changes are among the warnings.
 */
#define CAROM_REPAIR 2

/**
 * For carom_chain_load: refuses what is otherwise a warning.
 */
#define CAROM_STRICT 4

/**
 * For carom_chain_load: leaves out collision meshes, which single impacts do not use.
 */
#define CAROM_WITHOUT_MESHES 8

/**
 * Bit of carom_hit.flags: the law has increased the kinetic energy.
 */
#define CAROM_ENERGY_GAIN 1

/**
 * Bit of carom_hit.flags: friction jams (Painlevé): the normal impulse drives the contact deeper at first.
 */
#define CAROM_JAM 2

/**
 * Bit of carom_hit.flags: the outcome depends on a direction in which no impulse moves the contact.
 */
#define CAROM_SINGULAR 4

/**
 * Bit of carom_hit.flags: the approach is so slow beside the slip that rounding shows in angles and ratios.
 */
#define CAROM_GRAZING 8

/**
 * Bit of carom_hit.flags: more than one outcome satisfies the law.
 */
#define CAROM_NON_UNIQUE 16

/**
 * Bit of carom_hit.flags: the contact does not approach; the impulse is zero.
 */
#define CAROM_NO_APPROACH 32

/**
 * What a function returns. After any status but CAROM_OK, carom_error() tells what was wrong and what to do.
 */
typedef enum {
    /**
     * Done.
     */
    CAROM_OK = 0,
    /**
     * An argument breaks the rules of the call: NULL, a wrong length, an index out of range, arrays that overlap.
     */
    CAROM_INVALID_ARGUMENT = 1,
    /**
     * A file, a name or a number is refused: a URDF or a scene that breaks a rule, an unknown link, a coefficient out of its
     * range, a number that is not finite.
     */
    CAROM_REFUSED_INPUT = 2,
    /**
     * The arguments are sound, but the model has no answer for them: a singular normal direction, a mass matrix without an
     * inverse, an overlap at the start, a motion that cannot be continued.
     */
    CAROM_REFUSED_PHYSICS = 3,
    /**
     * A defect of carom, which was caught. Free the handles of the call: their contents are not defined any more.
     */
    CAROM_PANIC = 4,
} carom_status;

/**
 * How the contact moves along its surface at the end of an impact.
 */
typedef enum {
    /**
     * No impact took place: the contact does not approach.
     */
    CAROM_OPEN = 0,
    /**
     * No slip.
     */
    CAROM_STICK = 1,
    /**
     * Slip in the initial direction; in space, at most a right angle from it.
     */
    CAROM_SLIP = 2,
    /**
     * Slip opposite to the initial direction; in space, more than a right angle from it.
     */
    CAROM_REVERSE_SLIP = 3,
} carom_mode;

/**
 * A kinematic chain (a tree of links and joints) read from a URDF; it does not change. Any number of threads may use one at the
 * same time. What is made from it keeps what it needs, so that it may be freed at any time.
 */
typedef struct carom_chain carom_chain;

/**
 * The memory in which the dynamics of a chain are computed, allocated once. One thread at a time may use it.
 */
typedef struct carom_dynamics carom_dynamics;

/**
 * An impact law with its coefficients; it does not change. Any number of threads may use one at the same time.
 */
typedef struct carom_law carom_law;

/**
 * A scene file with its robots, read; it does not change. Any number of threads may use one at the same time.
 */
typedef struct carom_scene carom_scene;

/**
 * A run of a scene that a loop advances: read the state, set the joint forces, advance. One thread at a time may use it. Sessions
 * allocate.
 */
typedef struct carom_session carom_session;

/**
 * A contact point of a chain with its normal and the joints that are locked, checked once, with the memory for impacts there. One
 * thread at a time may use it.
 */
typedef struct carom_strike carom_strike;

/**
 * A joint that has entries in q and qd. A floating joint has q = x y z qx qy qz qw (m, unit quaternion), and its qd is the linear
 * (m/s), then the angular velocity (rad/s) of the child link in its axes; a planar joint has q = x y angle.
 */
typedef struct {
    /**
     * Its name, UTF-8; valid until the chain is freed.
     */
    const char *name;
    /**
     * Index of its first entry in q.
     */
    size_t q_index;
    /**
     * Number of its entries in q.
     */
    size_t q_count;
    /**
     * Index of its first entry in qd.
     */
    size_t v_index;
    /**
     * Number of its entries in qd.
     */
    size_t v_count;
    /**
     * Lower limit of the position, rad or m; -INFINITY without a limit.
     */
    double lower;
    /**
     * Upper limit of the position, rad or m; INFINITY without a limit.
     */
    double upper;
    /**
     * Limit of the speed, rad/s or m/s; INFINITY without a limit.
     */
    double velocity;
    /**
     * Limit of the effort, N m or N; INFINITY without a limit.
     */
    double effort;
} carom_joint;

/**
 * The result of one impact: what happens at the contact point. World axes, but for carom_law_resolve.
 */
typedef struct {
    /**
     * Impulse on the robot, N s.
     */
    double impulse[3];
    /**
     * Velocity of the contact point before, m/s.
     */
    double u_minus[3];
    /**
     * Velocity of the contact point after, m/s.
     */
    double u_plus[3];
    /**
     * Kinetic energy of the robot before, J.
     */
    double energy_before;
    /**
     * Kinetic energy of the robot after, J.
     */
    double energy_after;
    /**
     * Work of the normal impulse, J.
     */
    double normal_work;
    /**
     * Work of the tangential impulse, J.
     */
    double friction_work;
    /**
     * Work of the drives of locked joints, J; 0 with free joints.
     */
    double drive_work;
    /**
     * Contact mode at the end of the impact.
     */
    carom_mode mode;
    /**
     * Notes: a sum of CAROM_ENERGY_GAIN, CAROM_JAM, CAROM_SINGULAR, CAROM_GRAZING, CAROM_NON_UNIQUE and CAROM_NO_APPROACH.
     */
    uint32_t flags;
    /**
     * Of carom_strike_many: CAROM_OK, or why this state has no result; its numbers are then NaN.
     */
    carom_status status;
} carom_hit;

/**
 * An event of a session.
 */
typedef struct {
    /**
     * Time, s.
     */
    double time;
    /**
     * Its kind: "impact", "several" (contacts at once), "limit" (of a joint), "latch", "zeno", "sliding", "sticking", "free", "lift-off",
     * "joint-stops", "joint-moves", "stepping", "non-unique", "rest" …: the page "Simulate a scene" of the book. Valid until the session
     * is advanced, set to a state or freed.
     */
    const char *kind;
    /**
     * The contact or the joint, UTF-8; several are separated by "; ", and the text is empty if there is none. Valid as `kind`.
     */
    const char *contact;
    /**
     * Whether the joint velocities jump.
     */
    bool is_impact;
    /**
     * Sum of the impulses on the robot, N s, world axes; of a limit, which acts on a joint, zero.
     */
    double impulse[3];
} carom_event;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * What was wrong in the last call of this thread: the function, the value, the rule that it breaks, and what to do; an empty text
 * if the call has ended well. UTF-8, valid until the next call of this thread. Never NULL.
 */
const char *carom_error(void);

/**
 * The version of the library, such as "0.1.0". Never NULL, valid for ever.
 */
const char *carom_version(void);

/**
 * Reads a URDF file. `options`: 0, or a sum of CAROM_FLOATING_BASE, CAROM_REPAIR, CAROM_STRICT and CAROM_WITHOUT_MESHES. The
 * chain is freed by carom_chain_free. Refused input: a file that cannot be read or breaks a rule; the message names line,
 * element, value and rule.
 */
carom_status carom_chain_load(const char *path, uint32_t options, carom_chain **chain);

/**
 * Reads the text of a URDF, as carom_chain_load reads a file. Meshes with relative names are not found.
 */
carom_status carom_chain_parse(const char *urdf, uint32_t options, carom_chain **chain);

/**
 * Frees a chain; nothing for NULL.
 */
void carom_chain_free(carom_chain *chain);

/**
 * Name of the robot, UTF-8; valid until the chain is freed. NULL for NULL.
 */
const char *carom_chain_name(const carom_chain *chain);

/**
 * What loading has found odd in the file, and the changes of CAROM_REPAIR: one sentence a line, UTF-8; an empty text if there is
 * nothing. Valid until the chain is freed. NULL for NULL.
 */
const char *carom_chain_warnings(const carom_chain *chain);

/**
 * Length of q, the configuration: positions of the joints in the order of the file, an added floating base first; rad, m, unit
 * quaternion. 0 for NULL.
 */
size_t carom_chain_nq(const carom_chain *chain);

/**
 * Length of qd, the joint velocities: the degrees of freedom; rad/s, m/s. 0 for NULL.
 */
size_t carom_chain_nv(const carom_chain *chain);

/**
 * Number of joints that have entries in q and qd. 0 for NULL.
 */
size_t carom_chain_joint_count(const carom_chain *chain);

/**
 * Joint number `index`, from 0, of those that have entries in q and qd, in their order.
 */
carom_status carom_chain_joint(const carom_chain *chain, size_t index, carom_joint *joint);

/**
 * Number of frames: one for each link. 0 for NULL.
 */
size_t carom_chain_frame_count(const carom_chain *chain);

/**
 * Name of frame number `frame`, from 0, in the order of the file, UTF-8; valid until the chain is freed. NULL after a fault.
 */
const char *carom_chain_frame_name(const carom_chain *chain, size_t frame);

/**
 * The number of the frame of the link `name`, for the functions that take a frame. Refused input: no such link; the message has
 * the nearest names.
 */
carom_status carom_chain_frame(const carom_chain *chain, const char *name, size_t *frame);

/**
 * Makes the memory for the dynamics of a chain; freed by carom_dynamics_free. No other function of the dynamics allocates, but for
 * chains with mimic joints, and for the message of a fault.
 */
carom_status carom_dynamics_create(const carom_chain *chain, carom_dynamics **dynamics);

/**
 * Frees the memory; nothing for NULL.
 */
void carom_dynamics_free(carom_dynamics *dynamics);

/**
 * Pose of a frame at `q` (length nq): the homogeneous matrix of rotation and position (m) in the world, 4 × 4, row by row.
 */
carom_status carom_pose(carom_dynamics *dynamics, const double *q, size_t q_length, size_t frame, double pose[16]);

/**
 * Jacobian J of the velocity of a point at `q` (length nq): `jacobian` is 3 × nv, row by row, world axes; J qd is the velocity of the
 * point, m/s. `point`: the point in the axes of the frame, from its origin, m.
 */
carom_status carom_jacobian(carom_dynamics *dynamics,
                            const double *q,
                            size_t q_length,
                            size_t frame,
                            const double point[3],
                            double *jacobian,
                            size_t jacobian_length);

/**
 * Mass matrix M at `q` (length nq): `mass_matrix` is nv × nv, symmetric; kg m², kg m, kg.
 */
carom_status carom_mass_matrix(carom_dynamics *dynamics,
                               const double *q,
                               size_t q_length,
                               double *mass_matrix,
                               size_t mass_matrix_length);

/**
 * Delassus matrix H = J M⁻¹ Jᵀ of a point at `q` (length nq), the inverse inertia there: 3 × 3, symmetric, world axes, 1/kg. `point`
 * as in carom_jacobian. Refused physics: a joint that moves no inertia.
 */
carom_status carom_delassus(carom_dynamics *dynamics,
                            const double *q,
                            size_t q_length,
                            size_t frame,
                            const double point[3],
                            double delassus[9]);

/**
 * Inverse dynamics: the joint forces `tau` = M qdd + C qd + g (length nv; N m, N) at `q` (length nq), `qd` and `qdd` (length nv; rad/s²,
 * m/s²). With qdd = 0 they are the bias forces. `gravity`: the acceleration of free fall, world axes, m/s², such as {0, 0, -9.81}.
 */
carom_status carom_inverse_dynamics(carom_dynamics *dynamics,
                                    const double *q,
                                    size_t q_length,
                                    const double *qd,
                                    size_t qd_length,
                                    const double *qdd,
                                    size_t qdd_length,
                                    const double gravity[3],
                                    double *tau,
                                    size_t tau_length);

/**
 * Forward dynamics: the joint accelerations `qdd` = M⁻¹(tau − C qd − g) (length nv) at `q` (length nq), `qd` and `tau` (length nv).
 * Damping and friction of the joints are not included: add them to tau. `gravity` as in carom_inverse_dynamics. Refused physics: a
 * joint that moves no inertia.
 */
carom_status carom_forward_dynamics(carom_dynamics *dynamics,
                                    const double *q,
                                    size_t q_length,
                                    const double *qd,
                                    size_t qd_length,
                                    const double *tau,
                                    size_t tau_length,
                                    const double gravity[3],
                                    double *qdd,
                                    size_t qdd_length);

/**
 * Kinetic and potential energy, J, at `q` (length nq) and `qd` (length nv). `gravity` as in carom_inverse_dynamics; the potential energy is
 * zero for a centre of mass at the origin of the world.
 */
carom_status carom_energies(carom_dynamics *dynamics,
                            const double *q,
                            size_t q_length,
                            const double *qd,
                            size_t qd_length,
                            const double gravity[3],
                            double *kinetic,
                            double *potential);

/**
 * Makes a law by its name on the command line of carom: frictionless, whittaker, newton, poisson, energetic (Stronge), chatterjee-ruina,
 * brach or smith. `restitution`: 0 to 1. `friction`: Coulomb's coefficient, 0 or more; of brach the size of the impulse ratio.
 * `tangential_restitution`: -1 to 1, of chatterjee-ruina. Give 0 for a coefficient that the law does not have. The law is freed by
 * carom_law_free. Refused input: an unknown name, a coefficient out of its range or that the law does not have.
 */
carom_status carom_law_create(const char *name,
                              double restitution,
                              double friction,
                              double tangential_restitution,
                              carom_law **law);

/**
 * Frees a law; nothing for NULL.
 */
void carom_law_free(carom_law *law);

/**
 * The impact of one contact, without a robot: for the laws inside another simulator. `delassus` is the Delassus matrix H of the contact
 * (1/kg), row by row, symmetric and positive semidefinite; `velocity` the contact velocity u⁻ (m/s). Both are in contact axes: the
 * tangents first, then the normal, which points from the environment to the robot, so that an approach has a negative last
 * entry. In space H has 9 and u⁻ 3 numbers, in the plane 4 and 2.
 *
 * `hit` is in contact axes, too: the velocity afterwards is u⁺ = u⁻ + H p for its impulse p; its energies are those that impulses at
 * the contact can change. In the plane the impulse and the velocities are {tangent, normal, 0}. Allocates nothing, but for a hodograph
 * that needs integration and for the message of a fault.
 */
carom_status carom_law_resolve(const carom_law *law,
                               const double *delassus,
                               size_t delassus_length,
                               const double *velocity,
                               size_t velocity_length,
                               carom_hit *hit);

/**
 * Prepares impacts at a point of a link: checks what does not depend on the state, and allocates all memory. `frame`: the link, by
 * carom_chain_frame. `point`: the contact point in the axes of the link, from its origin, m. `normal`: the contact normal, world axes,
 * from the environment to the robot, of any length but zero. `locked`: names of joints that keep their velocities, separated by commas,
 * or "all"; NULL if all joints are free. The strike is freed by carom_strike_free.
 *
 * carom_strike_resolve and carom_strike_many allocate nothing but the message of a fault; for chains with mimic joints or more than 48
 * bodies, and for contacts that are nearly singular, they do. Refused physics: a link that no (free) joint moves.
 */
carom_status carom_strike_prepare(const carom_chain *chain,
                                  size_t frame,
                                  const double point[3],
                                  const double normal[3],
                                  const char *locked,
                                  carom_strike **strike);

/**
 * Frees a strike; nothing for NULL.
 */
void carom_strike_free(carom_strike *strike);

/**
 * The impact at the configuration `q` (length nq) with the joint velocities `qd` (length nv) under a law: writes the joint velocities
 * afterwards to `qd_plus` (length nv; rad/s, m/s), qd⁺ = qd + M⁻¹ Jᵀ p, and the rest to `hit`. A contact that does not approach is no
 * error: the impulse is zero, and the flag CAROM_NO_APPROACH is set. Refused physics: no joint moves the point along the normal
 * at this pose, a joint that moves no inertia, a contact that wedges; `qd_plus` and `hit` are then left as they were.
 */
carom_status carom_strike_resolve(carom_strike *strike,
                                  const carom_law *law,
                                  const double *q,
                                  size_t q_length,
                                  const double *qd,
                                  size_t qd_length,
                                  double *qd_plus,
                                  size_t qd_plus_length,
                                  carom_hit *hit);

/**
 * The impacts at `count` states, one after another, with the digits of carom_strike_resolve. `q` is count × nq, `qd` and `qd_plus` are
 * count × nv, row by row: a row for each state; `hits` has count entries. A state that is refused does not keep the others from being
 * computed: its numbers are NaN, its carom_hit.status is the reason, and the status that is returned, with its message, is that of the
 * first such state.
 */
carom_status carom_strike_many(carom_strike *strike,
                               const carom_law *law,
                               size_t count,
                               const double *q,
                               size_t q_length,
                               const double *qd,
                               size_t qd_length,
                               double *qd_plus,
                               size_t qd_plus_length,
                               carom_hit *hits);

/**
 * The first derivatives of qd⁺ at a state, within the contact mode of the impact: by the configuration, `by_q`, and by the joint
 * velocities, `by_qd`, nv × nv, row by row: entry (i, k) is that of qd⁺[i]; column k of `by_q` is the derivative along the
 * motion with unit qd[k]. `by_restitution` and `by_friction` (length nv) are those by the coefficients of the law. The contact point is
 * fixed on its link, the normal in the world. Allocates. Refused physics: as carom_strike_resolve, and joints that are locked.
 */
carom_status carom_strike_derivative(carom_strike *strike,
                                     const carom_law *law,
                                     const double *q,
                                     size_t q_length,
                                     const double *qd,
                                     size_t qd_length,
                                     double *by_q,
                                     size_t by_q_length,
                                     double *by_qd,
                                     size_t by_qd_length,
                                     double *by_restitution,
                                     size_t by_restitution_length,
                                     double *by_friction,
                                     size_t by_friction_length);

/**
 * Reads a scene (a TOML file: the page "Scene keys" of the book), its robots and their meshes; freed by carom_scene_free. Refused
 * input: a file that cannot be read or breaks a rule; the message names file, key, value and rule.
 */
carom_status carom_scene_load(const char *path, carom_scene **scene);

/**
 * Frees a scene; nothing for NULL. Its sessions stay.
 */
void carom_scene_free(carom_scene *scene);

/**
 * What is odd in the scene and its robots: one sentence a line, UTF-8; an empty text if there is nothing. Valid until the scene is freed.
 * NULL for NULL.
 */
const char *carom_scene_warnings(const carom_scene *scene);

/**
 * Runs the scene for its duration. `json` becomes the line that `carom simulate --json` prints: joints, stop_reason, mode, events, final,
 * energy, statistics. `warnings` becomes what is to be told of the results, one sentence a line; often an empty text. Both are UTF-8
 * and freed by carom_text_free. Refused physics: an overlap at the start, a motion that cannot be continued.
 */
carom_status carom_scene_summary_json(const carom_scene *scene,
                                      char **json,
                                      char **warnings);

/**
 * Frees a text of carom_scene_summary_json; nothing for NULL.
 */
void carom_text_free(char *text);

/**
 * Starts a session of a scene at its start; freed by carom_session_free. An impact at the start is among the events of the first
 * advance. Refused physics: an overlap at the start.
 */
carom_status carom_session_start(const carom_scene *scene, carom_session **session);

/**
 * Another session in the same state, which goes on independently: to try a motion, or to return to this state; freed by
 * carom_session_free.
 */
carom_status carom_session_copy(const carom_session *session, carom_session **copy);

/**
 * Frees a session; nothing for NULL.
 */
void carom_session_free(carom_session *session);

/**
 * The robot of the session, freed by carom_chain_free. Its joints are those of q and qd of the session: a scene is reduced to what
 * moves, so that they can be fewer than those of the file.
 */
carom_status carom_session_chain(const carom_session *session, carom_chain **chain);

/**
 * The time (s), the configuration `q` (length nq) and the joint velocities `qd` (length nv) now.
 */
carom_status carom_session_state(const carom_session *session,
                                 double *time,
                                 double *q,
                                 size_t q_length,
                                 double *qd,
                                 size_t qd_length);

/**
 * Starts again from another state at the present time: `q` (length nq), `qd` (length nv). Contacts, counts and energies begin anew.
 * Refused physics: an overlap.
 */
carom_status carom_session_set_state(carom_session *session, const double *q, size_t q_length, const double *qd, size_t qd_length);

/**
 * Sets constant joint forces in place of the controller, from now on: `forces` (length nv), N m and N.
 */
carom_status carom_session_set_forces(carom_session *session, const double *forces, size_t forces_length);

/**
 * Sets the controller kp (target − q) − kd qd in place of another one, from now on. `kp` (N m/rad, N/m) and `kd` (N m s/rad, N s/m) have the
 * length nv, `target` (rad, m) the length nq; numbers of floating and planar joints are not used.
 */
carom_status carom_session_set_targets(carom_session *session,
                                       const double *kp,
                                       size_t kp_length,
                                       const double *kd,
                                       size_t kd_length,
                                       const double *target,
                                       size_t target_length);

/**
 * Advances by `duration` (s); `count` becomes the number of events in it, which carom_session_event reads. Refused physics: a motion
 * that cannot be continued, more events than max_events of the scene; the session then stays where it was.
 */
carom_status carom_session_advance(carom_session *session,
                                   double duration,
                                   size_t *count);

/**
 * Advances to the next event, by `longest` (s) at most. `count` becomes the number of events at its time: an impact and the mode that
 * follows it are two; 0 if there is none. As carom_session_advance otherwise.
 */
carom_status carom_session_advance_to_event(carom_session *session,
                                            double longest,
                                            size_t *count);

/**
 * Event number `index`, from 0, of the last advance.
 */
carom_status carom_session_event(const carom_session *session, size_t index, carom_event *event);

/**
 * The joint velocities before and after event number `index` of the last advance, `qd_minus` and `qd_plus` (length nv; rad/s, m/s).
 */
carom_status carom_session_event_velocities(const carom_session *session,
                                            size_t index,
                                            double *qd_minus,
                                            size_t qd_minus_length,
                                            double *qd_plus,
                                            size_t qd_plus_length);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CAROM_H */
