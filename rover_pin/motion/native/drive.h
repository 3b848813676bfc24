/* A drive as the native step sees it, and what its files share. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define MAX_DOF 48
#define MAX_COLS 20
#define MAX_FACETS 64
#define MAX_STATES 8
#define MAX_OUT 192
#define N_SOIL 9
#define SOIL_N 5 /* place of the exponent n in a soil's constants */
#define N_GEOMETRY 7
#define N_WHEEL 2
#define N_RECORD 12
#define PI 3.14159265358979323846
#define UNDECIDED_SHARE 100.0 /* direction speed over the speed below which both speeds decide alike */
#define DEEPEST 0.98 /* sinkage over radius at which the law is held; drives stop long before */

typedef int64_t integer;
typedef int (*casadi_function)(const double **, double **, integer *, double *, int);

typedef struct { /* field order is mirrored in kernel.py */
  integer nq, nv, n_inertia, n_wheels, n_cols, n_axles, n_contact_states, n_motor_states, n_joints, n_servos, n_stops, n_body, n_lanes, grid_nx, grid_ny;
  integer n_soils, n_kinds, n_held;
  integer differential_left, n_coupled, symmetric, settling;
  double dt, direction_speed, grid_x0, grid_y0, grid_dx, grid_dy, wheel_share, misjudged;
  double *M, *nle, *q, *v, *du;
  double *rigid, *rigid_held, *gravity, *armature, *axes, *points, *rotation, *potential; /* rigid: the generated column, whose parts are the last four and nle */
  integer *inertia_place;
  integer *cols, *col_count, *wheel_dof, *axle;
  double *radius;
  integer *kind; /* wheels of one kind have the same sizes */
  double *kinds; /* radius and width of each kind */
  integer *joint_dof, *joint_q, *joint_unbounded;
  integer *servo_dof, *servo_q;
  double *servo_target, *servo_gain; /* gain: stiffness, damping */
  integer *stop_dof, *stop_q;
  double *stop_limits, *stop_gain; /* limits: lower, upper per stop */
  integer *body_dof, *body_q; /* base (6), then the suspension's joints; body_q: those joints alone */
  integer *coupled_dof; /* follower, leader of each coupling; a rigid differential is the last one, of ratio -1 */
  double *coupled_ratio;
  integer *mirror_index;
  double *mirror_sign;
  double *contact_states, *motor_states;
  double *contact_odd;
  double *contact_parameters, *motor_parameters, *body_parameters, *soils;
  double *held; /* what the contact law holds for each kind of wheel on each soil: n_kinds x n_soils x n_held */
  double *duty;
  double *lane_borders;
  integer *lane_start;
  double *lane_x, *lane_z;
  integer *lane_ground;
  double *grid_z;
  integer *grid_ground;
  double *foreseen; /* 4 a wheel: its load as the last step expected it */
  double *record, *energy, *loads, *impulse, *differential; /* record: n_wheels x N_RECORD; energy: 6; impulse: of the soil's forces; differential: its torque */
  casadi_function contact_before, contact_law, motor_law, body_law, rigid_body;
  integer *work_i;
  double *work_w;
} Drive;

enum { ENERGY_MOTOR, ENERGY_SOIL, ENERGY_STOPS, ENERGY_SERVOS, ENERGY_ELECTRIC, ENERGY_BODY };
enum { OK, NOT_FINITE, SINGULAR };
enum { DRIVING, IN_HAND, ON_THE_SOIL }; /* settling: in hand the soil is not sheared, whatever the speeds */

typedef struct {
  double s, t;       /* start point in the wheel plane, from the centre */
  double n_s, n_t;   /* in-plane unit normal */
  double normal[3];  /* normal in the world */
  integer ground;
} Facet;

typedef struct {
  double sinkage, depth, share, tilt, turn; /* sinkage of the facet's plane; greatest depth within the patch */
  double side; /* push of a lane's edge along y, per normal force */
  const Facet *facet;
} Patch;

typedef struct {
  double centre[3], axle[3], forward[3], up[3], velocity[3], spin;
  double lin[MAX_COLS][3], ang[MAX_COLS][3];
  const integer *cols;
  integer n;
} Wheel;

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

static void unit(double *a) {
  double scale = 1.0 / sqrt(dot(a, a));
  for (int i = 0; i < 3; ++i) a[i] *= scale;
}
