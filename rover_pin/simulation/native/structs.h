/* Sizes, records and small vector functions that all files of the step use. The struct Drive itself is written by
   shared.py. Vectors have three components x, y, z: x forward, y left, z up, in the world frame unless a comment
   says otherwise. A wheel's plane has the coordinates s (forward) and t (up) from the wheel's centre. */
#define PI 3.14159265358979323846
/* direction_speed over the speed below which rim and travel decide the direction alike; plain/law.py: UNDECIDED */
#define UNDECIDED_SHARE 100.0
/* sinkage over radius beyond which the contact law is evaluated at this value; a drive ends long before */
#define DEEPEST 0.98

/* Status of a step, and of the loop: loop.py has the same numbers in the enum Outcome. */
enum { OK, NOT_FINITE, SINGULAR, ASKS, FAILS };
/* values of Drive.settling. IN_HAND: the rover is held while it is set down, so that the soil is not sheared at any
   speed. ON_THE_SOIL: sheared soil alone holds it. */
enum { DRIVING, IN_HAND, ON_THE_SOIL };

/* One straight piece of ground in a wheel's plane. Facet k runs from its own start point to that of facet k + 1. */
typedef struct {
  double s, t;       /* start point [m] */
  double n_s, n_t;   /* unit normal within the wheel's plane, out of the ground */
  double normal[3];  /* unit normal of the ground in the world; it leans out of the wheel's plane on a side slope */
  integer ground;    /* index of its soil */
} Facet;

/* The contact of one wheel with one facet: a share of the load that the whole plane of the facet would carry. */
typedef struct {
  double sinkage;           /* depth of the rim under the facet's unbounded plane [m]: the h of the contact law */
  /* shares of the plane's load that this patch carries: of the forces, of the force that tilts from the normal
     towards the tangent, of the torque; each times the share of the wheel's width */
  double share, tilt, turn;
  /* force along y per normal force, where two strips of ground of unequal height share the wheel's width [-] */
  double side;
  double n_s, n_t, normal[3];
  integer ground;
} Patch;

_Static_assert(sizeof(Facet) == 8 * N_FACET && sizeof(Patch) == 8 * N_PATCH, "shared.py sizes their arrays");

/* kinematics of a wheel. lin, ang: Jacobian of the centre's velocity and of the angular velocity, one column for
   each degree of freedom above the wheel; rim: the part of ang along the axle */
typedef struct {
  _Alignas(64) double lin[3][MAX_COLS], ang[3][MAX_COLS], rim[MAX_COLS];
  /* centre [m], then unit vectors: axle to the left; s and t of the wheel's plane */
  double centre[3], axle[3], forward[3], up[3];
  double velocity[3], rate[3], spin; /* of the centre [m/s]; angular velocity [rad/s], and its part along the axle */
  const integer *cols; /* degree of freedom of each column */
  integer n, rows; /* number of columns, and of the vectors of 8 that hold them */
} Wheel;

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Inner product of two vectors that are stored in whole vectors of 8. The order of the sum is fixed, so that every
   processor gives the same bits. */
static double along(const double *row, const double *speeds, integer rows) {
  const Row *a = (const Row *)row, *b = (const Row *)speeds;
  Row sum = a[0] * b[0];
  for (integer k = 1; k < rows; ++k) sum += a[k] * b[k];
  return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
}

static void cross(const double *a, const double *b, double *out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Scale a vector to length 1. */
static void unit(double *a) {
  double scale = 1.0 / sqrt(dot(a, a));
  for (int i = 0; i < 3; ++i) a[i] *= scale;
}

/* Intermediate results of one step, in the order in which the step works them out: spots, questions, wheel loads,
   equations. */

/* a patch with its motion: one spot for each patch that touches, and one below each wheel that is in the air,
   because the states of effects go on there too */
typedef struct {
  Patch patch;
  double t[3], l[3];             /* unit vectors in the patch's plane: forward, and to the left */
  double contact[N_GEOMETRY];    /* inputs of the contact law: laws.py, GEOMETRY */
  double forwards, steep[2];     /* weight of the law for forward travel, 0 to 1, and its slopes with v_x and rim */
  const double *held;            /* precomputed constants of this kind of wheel on this soil */
  integer wheel, asked;          /* index of the wheel, and of the spot's first question to the contact law */
  int airborne;                  /* 1: below a wheel that does not touch */
} Spot;

/* one evaluation of the contact law: of this spot; with the direction of travel reversed; or with a slightly larger
   sinkage */
typedef struct {
  integer spot;
  int mirrored, deeper;
} Question;

/* load of the soil on one wheel. wrench: force [N] and moment [N m] at the centre as the step begins; slope: its
   derivatives with the change of the centre's velocity (3) and spin over the step */
typedef struct {
  double wrench[6], slope[6][4];
  /* f_t, f_y, f_n, torque: as the step begins, as expected at its end, and the slopes of the latter */
  double load[4], end[4], end_slope[4][4];
  /* sum of the patches' weights; change of the wheel's states over the step as gain + gain_slope . (change of
     velocity and spin) */
  double weight, gain[MAX_STATES], gain_slope[MAX_STATES][4];
  /* derivative of the wrench with the displacement of the centre; only while the rover is set down */
  double spring[6][3];
  /* change of the wheel's velocity and spin over the step, and the change that belongs to the mean force of the step */
  double moved[4], mean_moved[4];
} WheelLoad;

/* equations of the step, A du = dt force with A = mass - gamma dt D; kept: a copy of A that elimination does not
   overwrite; mean_du: the change of the speeds that belongs to the mean force */
typedef struct {
  _Alignas(64) double A[MAX_DOF][MAX_DOF], mass[MAX_DOF][MAX_DOF], kept[MAX_DOF][MAX_DOF], mean_du[MAX_DOF];
  double force[MAX_DOF], motor_torque[MAX_DOF], motor_slope[MAX_DOF], other_Q[MAX_DOF], other_slope[MAX_DOF];
  /* generalised force, and its parts from motors (motor_) and from servos and end stops (other_), with their slopes */
  double differential; /* torque of the differential on the left rocker [N m] */
} System;

/* push of the body effects on the degrees of freedom body_dof: Q + D du at the end of the step (D by columns), and
   the differential's torque, torque + torque_slope . du */
typedef struct {
  double Q[MAX_DOF], D[MAX_DOF * MAX_DOF], torque, torque_slope[MAX_DOF];
} BodyPush;

/* A spot asks at most four times: forwards and backwards, each also a little deeper. MAX_LAW: numbers in one answer,
   as laws.py writes them. */
#define MAX_QUESTIONS (4 * MAX_SPOTS)
#define MAX_LAW (4 + 16 + MAX_STATES * (9 + MAX_STATES) + 2)

typedef struct Step {
  /* aligned for the vectors that the laws write */
  _Alignas(64) double answers[MAX_QUESTIONS * MAX_LAW];
  Wheel wheels[MAX_DOF];
  System system;
  WheelLoad loads[MAX_DOF];
  BodyPush push;
  Spot spots[MAX_SPOTS];
  Question questions[MAX_QUESTIONS];
  const double *taken[MAX_QUESTIONS]; /* whose constants each SIMD lane still holds from the step before */
  /* change of each motor state over the step: constant part, and slope with mean_du of the wheel */
  double motor_steps[MAX_DOF][MAX_STATES][2];
  integer n_spots, n_questions;
} Step;
