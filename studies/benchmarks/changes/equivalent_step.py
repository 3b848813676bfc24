"""Changes of the compiled step that change no result: file, change as it is told, and the reason."""

HERE = "rover_pin/motion/native/"
PASSES = "Newton's method is at its end: a pass more moves nothing"
NOT_CROSSED = "not read where the rim does not cross the bisector"
NO_WEIGHT = "the other direction's answer has no weight where the wheel goes one way"
NEVER = "of 58 random drives each rest was met to 1e-8 within 33 steps, or missed by 9e-3 and more after all 300"
PATH = "how far one step of setting down goes: the rest is the same to 1e-11"

STEP: dict[tuple[str, str], str] = {
    (
        f"{HERE}arc.c",
        "double s = 1.0, c = 1.0;: 1.0 -> 1.1",
    ): "a tenth of the series' last term is below the last digit",
    (f"{HERE}grid.c", "most = 0.0;: 0.0 -> 0.1"): PASSES,
    (f"{HERE}grid.c", "double most = 1.0;: 1.0 -> 1.1"): PASSES,
    (
        f"{HERE}lanes.c",
        "double left = lane < d->n_lanes - 1 ? carried((d->lane_borders[lane] - low) / full, &left_slope) : 1.0;: "
        "- -> +",
    ): "the last lane's border is written too, at infinity: all is carried before it",
    (
        f"{HERE}lanes.c",
        "while (low > 0 && points[low] > x) --low; /* a bin's end, rounded */: > -> <=",
    ): "looked for from the first point: the same piece, or a rounding's neighbour beyond the wheel's reach",
    (
        f"{HERE}law.c",
        "if (spot->forwards > 0.0 && spot->forwards < 1.0) ask(s, index, 1, deeper);: 1.0 -> 1.1",
    ): NO_WEIGHT,
    (f"{HERE}law.c", "if (spot->forwards <= 0.0 || spot->forwards >= 1.0) return 1;: 1.0 -> 1.1"): NO_WEIGHT,
    (
        f"{HERE}patch.c",
        "corner.half = asin(smaller(1.0, larger(-1.0, ahead->n_s * f_s + ahead->n_t * f_t)));: 1.0 -> 1.1",
    ): "keeps round-off from an arcsine beyond 1, which only opposite normals come near",
    (f"{HERE}patch.c", "Corner corner = {-(ahead->s * f_s + ahead->t * f_t), 0.0, 0.0};: 0.0 -> 0.1"): NOT_CROSSED,
    (
        f"{HERE}control.c",
        "const double slip = l->table_duty ? slip_by_table(l, rate, d->duty[wheel]) : "
        "d->record[wheel * N_RECORD + RECORD_SLIP];: + -> -",
    ): "the slip comes first in the record: its place is 0",
    (
        f"{HERE}control.c",
        "return fmin(1.0, fmax(0.0, torque / l->stall_torque + sense * rate / l->no_load_rate));: 1.0 -> 1.1",
    ): "no duty beyond 1 is commanded, whatever a limit allows",
    (
        f"{HERE}settle.c",
        "const double slid = how == ON_THE_SOIL ? most_sheared(d, s) / s->most_slid : 0.0;: 0.0 -> 0.1",
    ): "a share counts from 1 on",
    (
        f"{HERE}law.c",
        "states[i * LANES + lane] = own[i] * (question.mirrored ? d->contact_odd[i] : 1.0);: * -> /",
    ): "a quotient by 1 or -1",
    (
        f"{HERE}settle.c",
        "#define SLOW 0.25 /* factors of the step's length after one that came no closer to rest, and after one that "
        "did */: 0.25 -> 0.275",
    ): PATH,
    (
        f"{HERE}settle.c",
        "const double slid = how == ON_THE_SOIL ? most_sheared(d, s) / s->most_slid : 0.0;: / -> *",
    ): PATH,
    (
        f"{HERE}settle.c",
        "d->q[2] += s->rise[0] * (s->place[0] - d->q[0]) + s->rise[1] * (s->place[1] - d->q[1]);: + -> -",
    ): "how high it is put back after a step, whose next ones find the height: the rest is the same to 1e-11",
    (f"{HERE}settle.c", "double most = 0.0;: 0.0 -> 0.1"): PATH,
    (
        f"{HERE}settle.c",
        "const double way = greatest_way(d, s) * 0.5 * dt / (FURTHEST * s->radius);: * -> /",
    ): PATH,
    (
        f"{HERE}settle.c",
        "if (rover_pin_step(d)) return -1;: return - -> return",
    ): "a step that failed left numbers that are not finite, which are taken back all the same",
    (f"{HERE}settle.c", "#define MOST_STEPS 300: 300 -> 330"): NEVER,
    (
        f"{HERE}settle.c",
        "#define AT_REST 1e-5 /* and what is still taken */: 1e-5 -> 1.1000000000000001e-05",
    ): NEVER,
    (
        f"{HERE}configuration.c",
        "#define SMALL_ANGLE 0.1: 0.1 -> 0.11000000000000001",
    ): "from 0.1 to 0.11 the series and the closed form are the same to the last digit",
}
