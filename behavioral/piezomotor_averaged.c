/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The averaged motor in C; piezomotor_averaged.h says what it is and how it is used.
 *
 * A quantity is q(t) = q_0 + Re(sum of Q_h exp(j h theta)), d theta/dt = 2 pi frequency. Every state obeys
 *
 *     y' = -rate y + force(y)
 *
 * with a constant rate, complex for an amplitude. The rates are treated implicitly, the forces explicitly, by the method
 * (2,3,2) of Ascher, Ruuth and Spiteri, Applied Numerical Mathematics 25 (1997) 151. It is of second order, and damps
 * free oscillations that are too fast for its step, such as those of a mode far from the drive.
 */
#include "piezomotor_averaged.h"

#include <math.h>
#include <stddef.h>

#define PI 3.14159265358979323846
#define LAG 20e-6             /* s, time constant of the static deflection; as in piezomotor_averaged_bending */
#define DEEPEST 1e-3          /* m, greatest penetration; as in piezomotor_averaged_phase */
#define CLOSED 1e-15          /* m, penetration from which on the contact counts as closed */
#define REFERENCE 100e3       /* Hz, at which the capacitances hold */
#ifndef STEP_OF_FASTEST
#define STEP_OF_FASTEST 0.7   /* internal step times the fastest rate of the contact */
#endif

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
static double power32(double x) { return x > 0.0 ? x * sqrt(x) : 0.0; }

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

/* One period of the contact: piezomotor_averaged_contact and piezomotor_averaged_phase. x is measured from the crown. */
static struct contact touch(const struct motor *m, const phasor x_part[], const phasor y_part[], double slider, double speed)
{
    const struct values *p = &m->value;
    double x[PHASES], y[PHASES], fx[PHASES], fy[PHASES];
    double deflection = 0.0;
    struct contact found = {.slider = slider};

    for (int i = 0; i < MODES; i++)
        deflection += p->mode[i].tip_y * p->mode[i].tip_y * p->preload / p->mode[i].stiffness;
    double seat = pow(p->preload / p->normal_stiffness, 2.0 / 3.0) + deflection;
    double ratio = p->friction * p->compliance * pow(p->normal_stiffness, 2.0 / 3.0);
    double grip = p->friction * p->normal_stiffness / pow(ratio, 1.5);
    double curve = 0.5 / p->radius;
    double turn = p->radius * speed / (PHASES * p->frequency);
    double rate = 0.5 * PHASES * p->frequency;

    synthesise(m, x_part, x);
    synthesise(m, y_part, y);
    for (int n = 0; n < PHASES; n++) {
        int before = (n + PHASES - 1) % PHASES, after = (n + 1) % PHASES;
        double depth = fmin(fmax(seat + y[n] - curve * x[n] * x[n], 0.0), DEEPEST);
        double approach = rate * (y[after] - y[before] - 2.0 * curve * x[n] * (x[after] - x[before]));
        double hold = fmax(1.0 + p->normal_damping * approach, 0.0);
        double normal = p->normal_stiffness * hold * power32(depth);
        /* slider: moved by the relative motion, clipped at the limit of stick */
        double limit = ratio * depth;
        double moved = found.slider + x[n] - x[before] + curve * (x[n] + x[before]) * (y[n] - y[before]) - turn;
        found.slider = fmax(-limit, fmin(limit, moved));
        double friction = copysign(
            p->friction * normal - grip * hold * power32(limit - fabs(found.slider)), found.slider);
        fx[n] = 2.0 * curve * x[n] * normal - friction;
        fy[n] = -normal - 2.0 * curve * x[n] * friction;
        found.normal += normal / PHASES;
        found.friction += friction / PHASES;
        if (depth < CLOSED)
            found.separated += 1.0 / PHASES;
        else if (fabs(moved) > limit)
            found.slip += 1.0 / PHASES;
    }
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

/* Return the rates of all states at the present temperature. */
static void find_rates(const struct motor *m, phasor rate[STATES])
{
    const struct values *p = &m->value;
    double drift = 1.0 + p->frequency_drift * m->state[TEMPERATURE].re;

    for (int s = 0; s < STATES; s++)
        rate[s] = (phasor){0.0, 0.0};
    rate[SPEED].re = p->bearing / p->inertia;
    rate[TEMPERATURE].re = 1.0 / (p->heat_capacity * p->thermal_resistance);
    rate[CARRIER_VELOCITY].re = MOUNTED ? p->mount_damping / p->mount_mass : 0.0;
    for (int i = 0; i < MODES; i++) {
        const struct mode *mode = &p->mode[i];
        rate[DEFLECTION + i].re = 1.0 / LAG;
        for (int h = 1; h <= HARMONICS; h++) {
            double omega = 2.0 * PI * h * p->frequency;
            phasor spring = {mode->stiffness * drift * drift - mode->mass * omega * omega, mode->damping * omega};
            rate[AMPLITUDE + HARMONICS * i + h - 1] = quotient(spring, inertance(mode, omega));
        }
    }
}

struct flow {
    phasor force[STATES];
    phasor current_a, current_b; /* A */
    phasor x, y;                 /* m, fundamental of the tip */
    double heat;                 /* W */
    struct contact contact;
};

/* Evaluate the motor in some state: the forces, and what the outputs need. */
static void evaluate(const struct motor *m, const phasor state[STATES], const phasor rate[STATES], struct flow *f)
{
    const struct values *p = &m->value;
    double angle = p->phase * PI / 180.0;
    phasor u_a = {p->amplitude_a, 0.0}, u_b = {p->amplitude_b * cos(angle), p->amplitude_b * sin(angle)};
    double warm = state[TEMPERATURE].re;
    double gain = 1.0 + p->coupling_drift * warm;
    phasor x[HARMONICS + 1] = {{0.0, 0.0}}, y[HARMONICS + 1] = {{0.0, 0.0}};

    /* groups: clamped capacitance with a constant loss tangent */
    double susceptance = 2.0 * PI * p->frequency * (1.0 + p->capacitance_drift * warm)
        * pow(REFERENCE / p->frequency, 2.0 / PI * atan(p->loss));
    phasor admittance = {susceptance * p->loss, susceptance};
    f->current_a = scaled(p->capacitance_a, product(admittance, u_a));
    f->current_b = scaled(p->capacitance_b, product(admittance, u_b));
    f->heat = 0.5 * admittance.re * (p->capacitance_a * square(u_a) + p->capacitance_b * square(u_b));

    /* tip: the sum of the modes; x from the crown of the rotor, which is above the tip at rest; y with the carrier */
    for (int i = 0; i < MODES; i++) {
        const struct mode *mode = &p->mode[i];
        x[0].re += mode->tip_x * (state[DEFLECTION + i].re + mode->tip_y * p->preload / mode->stiffness);
        y[0].re += mode->tip_y * state[DEFLECTION + i].re;
        for (int h = 1; h <= HARMONICS; h++) {
            phasor amplitude = state[AMPLITUDE + HARMONICS * i + h - 1];
            x[h] = sum(x[h], scaled(mode->tip_x, amplitude));
            y[h] = sum(y[h], scaled(mode->tip_y, amplitude));
        }
    }
    y[0].re += state[CARRIER].re;
    f->x = x[1];
    f->y = y[1];
    f->contact = touch(m, x, y, state[SLIDER].re, state[SPEED].re);

    /* modes */
    for (int i = 0; i < MODES; i++) {
        const struct mode *mode = &p->mode[i];
        double mean = mode->tip_x * f->contact.fx[0].re + mode->tip_y * f->contact.fy[0].re;
        f->force[DEFLECTION + i] = (phasor){mean / (mode->stiffness * LAG), 0.0};
        for (int h = 1; h <= HARMONICS; h++) {
            int s = AMPLITUDE + HARMONICS * i + h - 1;
            double omega = 2.0 * PI * h * p->frequency;
            phasor force = sum(scaled(mode->tip_x, f->contact.fx[h]), scaled(mode->tip_y, f->contact.fy[h]));
            if (h == 1)
                force = sum(force, scaled(gain, sum(scaled(mode->coupling_a, u_a), scaled(mode->coupling_b, u_b))));
            f->force[s] = quotient(force, inertance(mode, omega));
            phasor change = sum(f->force[s], scaled(-1.0, product(rate[s], state[s])));
            phasor velocity = sum(change, scaled(omega, turned(state[s])));
            f->heat += 0.5 * mode->damping * square(velocity);
            if (h == 1) {
                f->current_a = sum(f->current_a, scaled(gain * mode->coupling_a, velocity));
                f->current_b = sum(f->current_b, scaled(gain * mode->coupling_b, velocity));
            }
        }
    }

    /* carrier, rotor, slider, temperature */
    double push = MOUNTED ? p->preload + f->contact.fy[0].re - p->mount_stiffness * state[CARRIER].re : 0.0;
    f->force[CARRIER] = (phasor){state[CARRIER_VELOCITY].re, 0.0};
    f->force[CARRIER_VELOCITY] = (phasor){MOUNTED ? push / p->mount_mass : 0.0, 0.0};
    f->force[SPEED] = (phasor){(p->radius * f->contact.friction - p->load_torque) / p->inertia, 0.0};
    f->force[POSITION] = (phasor){state[SPEED].re, 0.0};
    f->force[SLIDER] = (phasor){p->frequency * (f->contact.slider - state[SLIDER].re), 0.0};
    f->force[TEMPERATURE] =
        (phasor){(f->heat + p->ambient_temperature / p->thermal_resistance) / p->heat_capacity, 0.0};
}

/* The motion that the harmonics left out would cause, relative to the static penetration and the limit of stick. */
static double check(const struct values *p, const struct contact *contact)
{
    double depth = pow(p->preload / p->normal_stiffness, 2.0 / 3.0);
    double limit = p->friction * p->compliance * pow(p->normal_stiffness, 2.0 / 3.0) * depth;
    double total = 0.0;

    for (int h = HARMONICS + 1; h < ORDERS; h++) {
        phasor x = {0.0, 0.0}, y = {0.0, 0.0};
        for (int i = 0; i < MODES; i++) {
            const struct mode *mode = &p->mode[i];
            double omega = 2.0 * PI * h * p->frequency;
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
    for (int s = 0; s < STATES; s++)
        motor->state[s] = (phasor){0.0, 0.0};
}

void motor_rest(struct motor *motor)
{
    const struct values *p = &motor->value;

    for (int s = 0; s < STATES; s++)
        motor->state[s] = (phasor){0.0, 0.0};
    for (int i = 0; i < MODES; i++)
        motor->state[DEFLECTION + i].re = -p->mode[i].tip_y * p->preload / p->mode[i].stiffness;
    motor->state[TEMPERATURE].re = p->ambient_temperature;
    motor_measure(motor);
}

void motor_measure(struct motor *motor)
{
    struct values *p = &motor->value;
    phasor rate[STATES];
    struct flow flow;
    double angle = p->phase * PI / 180.0;
    phasor back = {cos(angle), -sin(angle)}; /* turns a phase to that ahead of group B */

    find_rates(motor, rate);
    evaluate(motor, motor->state, rate, &flow);
    phasor current_b = product(flow.current_b, back);
    p->speed = motor->state[SPEED].re;
    p->position = motor->state[POSITION].re;
    p->current_amplitude_a = size(flow.current_a);
    p->current_phase_a = 180.0 / PI * atan2(flow.current_a.im, flow.current_a.re);
    p->current_amplitude_b = size(current_b);
    p->current_phase_b = 180.0 / PI * atan2(current_b.im, current_b.re);
    p->temperature = motor->state[TEMPERATURE].re;
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

/* The contact's stiffness, at eight times the preload, sets the rates at which the states act on each other. */
double motor_step(const struct motor *motor)
{
    const struct values *p = &motor->value;
    double omega = 2.0 * PI * p->frequency;
    double depth = pow(8.0 * p->preload / p->normal_stiffness, 2.0 / 3.0);
    double normal = 12.0 * p->preload * (1.0 / depth + p->normal_damping * omega);
    double tangential = 1.5 * cbrt(8.0 * p->preload) / p->compliance;
    double modes = 0.0, deflection = 0.0;

    for (int i = 0; i < MODES; i++) {
        const struct mode *mode = &p->mode[i];
        double stiffness = mode->tip_x * mode->tip_x * tangential + mode->tip_y * mode->tip_y * normal;
        modes += stiffness / (mode->mass * (omega + natural(mode)));
        deflection += stiffness / (mode->stiffness * LAG);
    }
    double rotor = p->radius * p->radius * tangential / p->inertia;
    double fastest = fmax(fmax(modes, deflection), fmax(sqrt(rotor), rotor / (4.0 * p->frequency)));
    if (MOUNTED)
        fastest = fmax(fastest, sqrt((normal + p->mount_stiffness) / p->mount_mass));
    return STEP_OF_FASTEST / fmax(fastest, p->frequency);
}

int motor_advance(struct motor *motor, double duration)
{
    const double gamma = 1.0 - sqrt(0.5), delta = -2.0 * sqrt(2.0) / 3.0;
    double count = ceil(duration / motor_step(motor));
    double h = duration / count;
    phasor rate[STATES], second[STATES], third[STATES], pull2, pull3;
    struct flow f1, f2, f3;

    for (double n = 0.0; n < count; n += 1.0) {
        phasor *y = motor->state;
        find_rates(motor, rate);
        evaluate(motor, y, rate, &f1);
        for (int s = 0; s < STATES; s++) {
            phasor divisor = {1.0 + gamma * h * rate[s].re, gamma * h * rate[s].im};
            second[s] = quotient(sum(y[s], scaled(gamma * h, f1.force[s])), divisor);
        }
        evaluate(motor, second, rate, &f2);
        for (int s = 0; s < STATES; s++) {
            phasor divisor = {1.0 + gamma * h * rate[s].re, gamma * h * rate[s].im};
            pull2 = product(rate[s], second[s]);
            phasor pushed = sum(scaled(delta * h, f1.force[s]), scaled((1.0 - delta) * h, f2.force[s]));
            third[s] = quotient(sum(sum(y[s], pushed), scaled(-(1.0 - gamma) * h, pull2)), divisor);
        }
        evaluate(motor, third, rate, &f3);
        for (int s = 0; s < STATES; s++) {
            pull2 = sum(f2.force[s], scaled(-1.0, product(rate[s], second[s])));
            pull3 = sum(f3.force[s], scaled(-1.0, product(rate[s], third[s])));
            y[s] = sum(y[s], sum(scaled((1.0 - gamma) * h, pull2), scaled(gamma * h, pull3)));
        }
        for (int s = 0; s < STATES; s++)
            if (!isfinite(y[s].re) || !isfinite(y[s].im))
                return -1;
    }
    motor_measure(motor);
    return 0;
}
