/* What a step works with, from its patches to its equations. */

typedef struct { /* a patch that touches, or stands below a wheel in the air: where, and how it moves */
  Patch patch;
  double t[3], l[3];             /* forward and lateral in the patch's plane */
  double contact[N_GEOMETRY];
  double forwards, steep[2];     /* share of the forward law, and its slopes with v_x and rim */
  const double *held;
  integer wheel, asked;          /* its first question to the laws */
  int airborne;
} Spot;

typedef struct { /* one question to the contact law */
  integer spot;
  int mirrored, deeper;
} Question;

typedef struct { /* what the soil does to a wheel at its centre, and its slopes with velocity (3) and spin */
  double wrench[6], slope[6][4];
  double load[4], end[4], end_slope[4][4];     /* f_t f_y f_n torque: now, and expected at the step's end */
  double weight, gain[MAX_STATES], gain_slope[MAX_STATES][4]; /* change of its states */
  double spring[6][3];                         /* slope with the way, while the rover is set down */
  double moved[4], mean_moved[4];              /* change of its velocity and spin, and that of its mean load */
} WheelLoad;

typedef struct { /* A = mass - gamma dt D, force, and their parts; mean_du: the change of speeds in the mean forces */
  _Alignas(64) double A[MAX_DOF][MAX_DOF], mass[MAX_DOF][MAX_DOF], kept[MAX_DOF][MAX_DOF], mean_du[MAX_DOF];
  double force[MAX_DOF], motor_torque[MAX_DOF], motor_slope[MAX_DOF], other_Q[MAX_DOF], other_slope[MAX_DOF];
  double differential; /* torque on the left rocker */
} System;

typedef struct { /* what acts on the n degrees of freedom body_dof: force Q + D du (D by columns), and T of the differential */
  double Q[MAX_DOF], D[MAX_DOF * MAX_DOF], torque, torque_slope[MAX_DOF];
} BodyPush;

#define MAX_QUESTIONS (4 * MAX_SPOTS)
#define MAX_LAW (4 + 16 + MAX_STATES * (9 + MAX_STATES) + 2)

typedef struct Step {
  _Alignas(64) double answers[MAX_QUESTIONS * MAX_LAW];
  Wheel wheels[MAX_DOF];
  System system;
  WheelLoad loads[MAX_DOF];
  BodyPush push;
  Spot spots[MAX_SPOTS];
  Question questions[MAX_QUESTIONS];
  const double *taken[MAX_QUESTIONS]; /* whose constants each lane holds */
  double motor_steps[MAX_DOF][MAX_STATES][2];
  integer n_spots, n_questions;
} Step;
