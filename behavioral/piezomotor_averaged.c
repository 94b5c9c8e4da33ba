/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The averaged motor in C; piezomotor_averaged.h says what it is and how it is used.
 *
 * A quantity is q(t) = q_0 + Re(sum of Q_h exp(j h theta)), d theta/dt = 2 pi frequency. The states are integrated by the
 * second backward differentiation formula (Gear's method), with three steps in a period of the drive or of the fastest mode.
 * As in the decks for ngspice, this damps free oscillations that the averages do not describe, such as those of a mode far
 * from the drive and of a standing rotor on the contact. Newton's method solves the equations of a step.
 */
#include "piezomotor_averaged.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "piezomotor_phase.h" /* written by the export from piezomotor_averaged_phase.lib */

#define PI 3.14159265358979323846
#define LAG 20e-6             /* s, time constant of the static deflection; as in piezomotor_averaged_bending */
#define REFERENCE 100e3       /* Hz, at which the capacitances hold */
#ifndef STEPS_OF_PERIOD
#define STEPS_OF_PERIOD 3     /* internal steps in a period of the drive or of the fastest mode */
#endif
#define SOLVED 1e-8           /* change of the states in Newton's method, over their scales */
#define ITERATIONS 8          /* with one Jacobian matrix */
#define HALVINGS 12           /* of a step whose equations are not solved */

static phasor sum(phasor a, phasor b) { return (phasor){a.re + b.re, a.im + b.im}; }
static phasor scaled(double factor, phasor a) { return (phasor){factor * a.re, factor * a.im}; }
static phasor product(phasor a, phasor b) { return (phasor){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
static phasor quotient(phasor a, phasor b)
{
    double square = b.re * b.re + b.im * b.im;
    return (phasor){(a.re * b.re + a.im * b.im) / square, (a.im * b.re - a.re * b.im) / square};
}
static double square(phasor a) { return a.re * a.re + a.im * a.im; }
static double size(phasor a) { return sqrt(square(a)); }
static phasor turned(phasor a) { return (phasor){-a.im, a.re}; } /* j a */

/* --- the contact --- */

struct contact {
    phasor fx[ORDERS], fy[ORDERS]; /* N, force on the tip; [0] is the mean */
    double normal, friction;       /* N, means */
    double separated, slip;        /* shares of the period */
    double slider;                 /* m, at the end of the period */
};

/* Sum the harmonics of a displacement at every phase. */
static void synthesise(const struct motor *m, const phasor part[HARMONICS + 1], double at[PHASES])
{
    for (int n = 0; n < PHASES; n++) {
        at[n] = part[0].re;
        for (int h = 1; h <= HARMONICS; h++)
            at[n] += part[h].re * m->wheel[n][h].re - part[h].im * m->wheel[n][h].im;
    }
}

/* Return the mean and the harmonics of a force. */
static void analyse(const struct motor *m, const double at[PHASES], phasor part[ORDERS])
{
    for (int h = 0; h < ORDERS; h++)
        part[h] = (phasor){0.0, 0.0};
    for (int n = 0; n < PHASES; n++)
        for (int h = 0; h < ORDERS; h++) {
            part[h].re += at[n] * m->wheel[n][h].re;
            part[h].im -= at[n] * m->wheel[n][h].im;
        }
    for (int h = 0; h < ORDERS; h++)
        part[h] = scaled((h == 0 ? 1.0 : 2.0) / PHASES, part[h]);
}

/* One period of the contact. x is measured from the crown; piezomotor_phase.h takes displacements in um. */
static struct contact touch(const struct motor *m, const phasor x_part[], const phasor y_part[], double slider, double speed)
{
    const struct values *p = &m->value;
    double x[PHASES], y[PHASES], fx[PHASES], fy[PHASES];
    double deflection = 0.0;
    struct contact found = {0};

    for (int i = 0; i < MODES; i++)
        deflection += p->mode[i].tip_y * p->mode[i].tip_y * p->preload / p->mode[i].stiffness;
    struct phase at = {
        .normal_stiffness = p->normal_stiffness, .compliance = p->compliance, .mu = p->friction, .radius = p->radius,
        .preload = p->preload, .deflection = 1e6 * deflection, .damping = p->normal_damping, .series = p->series_compliance,
        .slider_before = 1e6 * slider, .turn = 1e6 * p->radius * speed / (PHASES * p->frequency),
        .rate = 0.5 * PHASES * p->frequency,
    };
    phase_parameters(&at);

    synthesise(m, x_part, x);
    synthesise(m, y_part, y);
    for (int n = 0; n < PHASES; n++) {
        x[n] *= 1e6;
        y[n] *= 1e6;
    }
    for (int n = 0; n < PHASES; n++) {
        int before = (n + PHASES - 1) % PHASES, after = (n + 1) % PHASES;
        at.x = x[n], at.x_before = x[before], at.x_after = x[after];
        at.y = y[n], at.y_before = y[before], at.y_after = y[after];
        phase_forces(&at);
        at.slider_before = at.slider;
        fx[n] = at.fx;
        fy[n] = at.fy;
        found.normal += at.normal / PHASES;
        found.friction += at.friction / PHASES;
        found.separated += at.open / PHASES;
        found.slip += at.slip / PHASES;
    }
    found.slider = 1e-6 * at.slider;
    analyse(m, fx, found.fx);
    analyse(m, fy, found.fy);
    return found;
}

/* --- the motor --- */

static double natural(const struct mode *mode) { return sqrt(mode->stiffness / mode->mass); } /* rad/s */

/* Factor of the rate of an amplitude in its equation of motion: c + j m (omega + omega_0). */
static phasor inertance(const struct mode *mode, double omega)
{
    return (phasor){mode->damping, mode->mass * (omega + natural(mode))};
}

struct flow {
    double rate[STATES];
    phasor current_a, current_b; /* A */
    phasor x, y;                 /* m, fundamental of the tip */
    double heat;                 /* W */
    struct contact contact;
};

/* A mode, or the carrier towards and along the rotor, which the drive does not move. */
static struct mode moving(const struct values *p, int number)
{
    if (number < MODES)
        return p->mode[number];
    if (number == MODES)
        return (struct mode){.mass = p->mount_mass, .damping = p->mount_damping, .stiffness = p->mount_stiffness, .tip_y = 1.0};
    return (struct mode){
        .mass = p->mount_x_mass, .damping = p->mount_x_damping, .stiffness = p->mount_x_stiffness, .tip_x = 1.0};
}

/* The place of an amplitude among the states. */
static int place(int mode, int harmonic) { return AMPLITUDE + 2 * (HARMONICS * mode + harmonic - 1); }

/* Evaluate the motor in some state: the rates of the states, and what the outputs need. */
static void evaluate(const struct motor *m, const double state[STATES], struct flow *f)
{
    const struct values *p = &m->value;
    double angle = p->phase * PI / 180.0;
    phasor u_a = {p->amplitude_a, 0.0}, u_b = {p->amplitude_b * cos(angle), p->amplitude_b * sin(angle)};
    double warm = state[TEMPERATURE];
    double gain = 1.0 + p->coupling_drift * warm, drift = 1.0 + p->frequency_drift * warm;
    phasor x[HARMONICS + 1] = {{0.0, 0.0}}, y[HARMONICS + 1] = {{0.0, 0.0}};

    /* groups: clamped capacitances with a constant loss tangent */
    double susceptance = 2.0 * PI * p->frequency * (1.0 + p->capacitance_drift * warm)
        * pow(REFERENCE / p->frequency, 2.0 / PI * atan(p->loss));
    phasor admittance = {susceptance * p->loss, susceptance};
    phasor q_a = sum(scaled(p->capacitance_a, u_a), scaled(-p->capacitance_ab, u_b));
    phasor q_b = sum(scaled(p->capacitance_b, u_b), scaled(-p->capacitance_ab, u_a));
    f->current_a = product(admittance, q_a);
    f->current_b = product(admittance, q_b);
    f->heat = 0.5 * admittance.re * (q_a.re * u_a.re + q_a.im * u_a.im + q_b.re * u_b.re + q_b.im * u_b.im);

    /* tip: the sum of the modes; x from the crown of the rotor, which is above the tip at rest; y with the carrier */
    for (int i = 0; i < MODES; i++) {
        const struct mode *mode = &p->mode[i];
        x[0].re += mode->tip_x * (state[DEFLECTION + i] + mode->tip_y * p->preload / mode->stiffness);
        y[0].re += mode->tip_y * state[DEFLECTION + i];
    }
    for (int i = 0; i < MOVING; i++) {
        struct mode mode = moving(p, i);
        for (int h = 1; h <= HARMONICS; h++) {
            phasor amplitude = {state[place(i, h)], state[place(i, h) + 1]};
            x[h] = sum(x[h], scaled(mode.tip_x, amplitude));
            y[h] = sum(y[h], scaled(mode.tip_y, amplitude));
        }
    }
    x[0].re += state[CARRIER_X];
    y[0].re += state[CARRIER];
    f->x = x[1];
    f->y = y[1];
    f->contact = touch(m, x, y, state[SLIDER], state[SPEED] - state[CARRIER_X_VELOCITY] / p->radius);

    /* modes */
    for (int i = 0; i < MODES; i++) {
        const struct mode *mode = &p->mode[i];
        double mean = mode->tip_x * f->contact.fx[0].re + mode->tip_y * f->contact.fy[0].re;
        f->rate[DEFLECTION + i] = (mean / mode->stiffness - state[DEFLECTION + i]) / LAG;
    }
    for (int i = 0; i < MOVING; i++) {
        struct mode one = moving(p, i), *mode = &one;
        double stiffness = i < MODES ? mode->stiffness * drift * drift : mode->stiffness;
        for (int h = 1; h <= HARMONICS; h++) {
            int s = place(i, h);
            double omega = 2.0 * PI * h * p->frequency;
            phasor amplitude = {state[s], state[s + 1]};
            phasor spring = {stiffness - mode->mass * omega * omega, mode->damping * omega};
            phasor force = sum(scaled(mode->tip_x, f->contact.fx[h]), scaled(mode->tip_y, f->contact.fy[h]));
            if (h == 1)
                force = sum(force, scaled(gain, sum(scaled(mode->coupling_a, u_a), scaled(mode->coupling_b, u_b))));
            force = sum(force, scaled(-1.0, product(spring, amplitude)));
            phasor rate = quotient(force, inertance(mode, omega));
            phasor velocity = sum(rate, scaled(omega, turned(amplitude)));
            f->rate[s] = rate.re;
            f->rate[s + 1] = rate.im;
            if (i < MODES)
                f->heat += 0.5 * mode->damping * square(velocity);
            if (h == 1) {
                f->current_a = sum(f->current_a, scaled(gain * mode->coupling_a, velocity));
                f->current_b = sum(f->current_b, scaled(gain * mode->coupling_b, velocity));
            }
        }
    }

    /* carrier, rotor, slider, temperature */
    double push = p->preload + f->contact.fy[0].re - p->mount_stiffness * state[CARRIER]
        - p->mount_damping * state[CARRIER_VELOCITY];
    double push_x = f->contact.fx[0].re - p->mount_x_stiffness * state[CARRIER_X]
        - p->mount_x_damping * state[CARRIER_X_VELOCITY];
    double drive = p->radius * f->contact.friction - p->load_torque - p->bearing * state[SPEED];
    double cooling = (state[TEMPERATURE] - p->ambient_temperature) / p->thermal_resistance;
    f->rate[CARRIER] = state[CARRIER_VELOCITY];
    f->rate[CARRIER_VELOCITY] = MOUNTED ? push / p->mount_mass : 0.0;
    f->rate[CARRIER_X] = state[CARRIER_X_VELOCITY];
    f->rate[CARRIER_X_VELOCITY] = MOUNTED_X ? push_x / p->mount_x_mass : 0.0;
    f->rate[SPEED] = drive / p->inertia;
    f->rate[POSITION] = state[SPEED];
    f->rate[SLIDER] = p->frequency * (f->contact.slider - state[SLIDER]);
    f->rate[TEMPERATURE] = (f->heat - cooling) / p->heat_capacity;
}

/* The motion that the harmonics left out would cause, relative to the static penetration and the limit of stick. */
static double check(const struct values *p, const struct contact *contact)
{
    double depth = pow(p->preload / p->normal_stiffness, 2.0 / 3.0);
    double limit = p->friction * p->compliance * pow(p->normal_stiffness, 2.0 / 3.0) * depth;
    double total = 0.0;

    for (int h = HARMONICS + 1; h < ORDERS; h++) {
        double omega = 2.0 * PI * h * p->frequency;
        phasor x = {0.0, 0.0}, y = {0.0, 0.0};
        for (int i = 0; i < MOVING; i++) {
            struct mode one = moving(p, i), *mode = &one;
            phasor spring = {mode->stiffness - mode->mass * omega * omega, mode->damping * omega};
            phasor force = sum(scaled(mode->tip_x, contact->fx[h]), scaled(mode->tip_y, contact->fy[h]));
            phasor moved = quotient(force, spring);
            x = sum(x, scaled(mode->tip_x, moved));
            y = sum(y, scaled(mode->tip_y, moved));
        }
        total += square(x) / (limit * limit) + square(y) / (depth * depth);
    }
    return sqrt(total);
}

/* --- what others call --- */

void motor_default(struct motor *motor)
{
    static const double start[] = START; /* inputs, outputs (0), parameters, in the order of struct values */
    double *value = (double *)&motor->value;

    _Static_assert(sizeof start == sizeof motor->value, "piezomotor_start.h does not fit piezomotor_averaged.h");
    for (size_t i = 0; i < sizeof start / sizeof *start; i++)
        value[i] = start[i];
    for (int n = 0; n < PHASES; n++)
        for (int h = 0; h < ORDERS; h++)
            motor->wheel[n][h] = (phasor){cos(2.0 * PI * h * n / PHASES), sin(2.0 * PI * h * n / PHASES)};
    memset(motor->state, 0, sizeof motor->state);
    memset(motor->before, 0, sizeof motor->before);
    motor->step = 0.0;
}

void motor_rest(struct motor *motor)
{
    const struct values *p = &motor->value;

    memset(motor->state, 0, sizeof motor->state);
    motor->step = 0.0;
    for (int i = 0; i < MODES; i++)
        motor->state[DEFLECTION + i] = -p->mode[i].tip_y * p->preload / p->mode[i].stiffness;
    motor->state[TEMPERATURE] = p->ambient_temperature;
    motor_measure(motor);
}

void motor_measure(struct motor *motor)
{
    struct values *p = &motor->value;
    struct flow flow;
    double angle = p->phase * PI / 180.0;
    phasor back = {cos(angle), -sin(angle)}; /* turns a phase to that ahead of group B */

    evaluate(motor, motor->state, &flow);
    phasor current_b = product(flow.current_b, back);
    p->speed = motor->state[SPEED];
    p->position = motor->state[POSITION];
    p->current_amplitude_a = size(flow.current_a);
    p->current_phase_a = 180.0 / PI * atan2(flow.current_a.im, flow.current_a.re);
    p->current_amplitude_b = size(current_b);
    p->current_phase_b = 180.0 / PI * atan2(current_b.im, current_b.re);
    p->temperature = motor->state[TEMPERATURE];
    p->check = check(p, &flow.contact);
    p->separated = flow.contact.separated;
    p->slip = flow.contact.slip;
    p->torque = p->radius * flow.contact.friction;
    p->normal_force = flow.contact.normal;
    p->electrical_power = 0.5 * (p->amplitude_a * flow.current_a.re + p->amplitude_b * current_b.re);
    p->heat = flow.heat;
    p->tip_x_amplitude = size(flow.x);
    p->tip_y_amplitude = size(flow.y);
}

/* --- integration --- */

struct solver {
    double scale[STATES];            /* of the states: the static penetration, and what moves the tip by it in a period */
    double jacobian[STATES][STATES];
    double matrix[STATES][STATES];   /* 1 - weight * jacobian, decomposed */
    int pivot[STATES];
    double weight;                   /* s; 0 if the matrix is not that of the Jacobian */
};

static void find_scales(const struct motor *m, double scale[STATES])
{
    const struct values *p = &m->value;
    double depth = pow(p->preload / p->normal_stiffness, 2.0 / 3.0);

    for (int s = 0; s < STATES; s++)
        scale[s] = depth;
    for (int i = 0; i < MODES; i++)
        for (int s = place(i, 1); s < place(i + 1, 1); s++)
            scale[s] = depth / fmax(1e-6, fmax(fabs(p->mode[i].tip_x), fabs(p->mode[i].tip_y)));
    scale[POSITION] = depth / p->radius;
    scale[SPEED] = scale[POSITION] * p->frequency;
    scale[CARRIER_VELOCITY] = scale[CARRIER_X_VELOCITY] = depth * p->frequency;
    scale[TEMPERATURE] = 1.0;
}

static void find_jacobian(const struct motor *m, const double state[STATES], struct solver *solver)
{
    struct flow here, there;
    double moved[STATES];

    evaluate(m, state, &here);
    for (int column = 0; column < STATES; column++) {
        double change = 1e-6 * solver->scale[column];
        memcpy(moved, state, sizeof moved);
        moved[column] += change;
        evaluate(m, moved, &there);
        for (int row = 0; row < STATES; row++)
            solver->jacobian[row][column] = (there.rate[row] - here.rate[row]) / change;
    }
    solver->weight = 0.0;
}

/* Decompose 1 - weight * jacobian into triangles, with pivots. */
static void decompose(struct solver *solver, double weight)
{
    double (*a)[STATES] = solver->matrix;

    for (int row = 0; row < STATES; row++)
        for (int column = 0; column < STATES; column++)
            a[row][column] = (row == column) - weight * solver->jacobian[row][column];
    for (int k = 0; k < STATES; k++) {
        int best = k;
        for (int row = k + 1; row < STATES; row++)
            if (fabs(a[row][k]) > fabs(a[best][k]))
                best = row;
        solver->pivot[k] = best;
        for (int column = 0; column < STATES; column++) {
            double kept = a[k][column];
            a[k][column] = a[best][column];
            a[best][column] = kept;
        }
        for (int row = k + 1; row < STATES; row++) {
            a[row][k] /= a[k][k];
            for (int column = k + 1; column < STATES; column++)
                a[row][column] -= a[row][k] * a[k][column];
        }
    }
    solver->weight = weight;
}

static void substitute(const struct solver *solver, double vector[STATES])
{
    for (int k = 0; k < STATES; k++) {
        double kept = vector[solver->pivot[k]];
        vector[solver->pivot[k]] = vector[k];
        vector[k] = kept;
    }
    for (int row = 1; row < STATES; row++)
        for (int column = 0; column < row; column++)
            vector[row] -= solver->matrix[row][column] * vector[column];
    for (int row = STATES - 1; row >= 0; row--) {
        for (int column = row + 1; column < STATES; column++)
            vector[row] -= solver->matrix[row][column] * vector[column];
        vector[row] /= solver->matrix[row][row];
    }
}

/* Solve state = known + weight * rate(state) from a guess; return whether Newton's method ends. */
static int solved(const struct motor *m, struct solver *solver, const double known[STATES], double weight, double state[STATES])
{
    struct flow flow;
    double change[STATES];

    if (fabs(solver->weight - weight) > 1e-6 * weight)
        decompose(solver, weight);
    for (int n = 0; n < ITERATIONS; n++) {
        double largest = 0.0;
        evaluate(m, state, &flow);
        for (int s = 0; s < STATES; s++)
            change[s] = known[s] + weight * flow.rate[s] - state[s];
        substitute(solver, change);
        for (int s = 0; s < STATES; s++) {
            state[s] += change[s];
            largest = fmax(largest, isfinite(state[s]) ? fabs(change[s]) / solver->scale[s] : INFINITY);
        }
        if (largest <= SOLVED)
            return 1;
        if (!isfinite(largest))
            return 0;
    }
    return 0;
}

/* Advance by one step, or by two halves if its equations are not solved. */
static int advance(struct motor *m, struct solver *solver, double step, int halvings)
{
    double ratio = m->step > 0.0 && step < 2.0 * m->step ? step / m->step : 0.0; /* 0: the first, implicit Euler's formula */
    double weight = step * (1.0 + ratio) / (1.0 + 2.0 * ratio);
    double known[STATES], state[STATES];

    for (int s = 0; s < STATES; s++) {
        double change = m->state[s] - m->before[s];
        known[s] = m->state[s] + ratio * ratio / (1.0 + 2.0 * ratio) * change;
        state[s] = m->state[s] + ratio * change;
    }
    int done = solved(m, solver, known, weight, state);
    if (!done) {
        memcpy(state, m->state, sizeof state);
        find_jacobian(m, state, solver);
        done = solved(m, solver, known, weight, state);
    }
    if (done) {
        memcpy(m->before, m->state, sizeof state);
        memcpy(m->state, state, sizeof state);
        m->step = step;
        return 0;
    }
    if (halvings == 0)
        return -1;
    return advance(m, solver, 0.5 * step, halvings - 1) != 0 ? -1 : advance(m, solver, 0.5 * step, halvings - 1);
}

double motor_step(const struct motor *motor)
{
    double fastest = motor->value.frequency;

    for (int i = 0; i < MODES; i++)
        fastest = fmax(fastest, natural(&motor->value.mode[i]) / (2.0 * PI));
    return 1.0 / (STEPS_OF_PERIOD * fastest);
}

int motor_advance(struct motor *motor, double duration)
{
    double count = ceil(duration / motor_step(motor));
    struct solver solver;

    find_scales(motor, solver.scale);
    find_jacobian(motor, motor->state, &solver);
    for (double n = 0.0; n < count; n += 1.0)
        if (advance(motor, &solver, duration / count, HALVINGS) != 0)
            return -1;
    motor_measure(motor);
    return 0;
}
