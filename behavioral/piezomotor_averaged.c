/* SPDX-License-Identifier: MIT
 *
 * The averaged motor in C; piezomotor_averaged.h says what it is and how it is used.
 *
 * A quantity is q(t) = q_0 + Re(sum of Q_h exp(j h theta)), d theta/dt = 2 pi frequency. The states are integrated by
 * TR-BDF2: the trapezoidal rule for a part of a step, then the second backward differentiation formula for the whole. The
 * difference to the formula of third order with the same rates is divided twice by 1 - weight * Jacobian matrix and added: the
 * sum is of third order and L-stable. The difference of the two quotients is the estimated error, from which the step follows,
 * down to a quarter of a period of the drive. A step needs no step before it but for the guesses of Newton's method, so that
 * inputs may jump between two steps. Newton's method solves both stages with one matrix, which is kept until the step or the
 * motor's Jacobian matrix has changed; where it is known to end in one iteration, there is one.
 *
 * SOURCE R. E. Bank et al., IEEE Trans. CAD 4 (1985) 436; M. E. Hosea, L. F. Shampine, Appl. Numer. Math. 20 (1996) 21
 */
#include "piezomotor_averaged.h"

#include <math.h>
#include <string.h>

#include "piezomotor_phase.h" /* written by the export from piezomotor_averaged_phase.lib */

#define PI 3.14159265358979323846
#define LAG 20e-6             /* s, time constant of the static deflection; as in piezomotor_averaged_bending */
#define REFERENCE 100e3       /* Hz, at which the capacitances hold */
#ifndef TOLERANCE
#define TOLERANCE 1e-4        /* error of the states in a step, over their scales */
#endif
#define SWEEPS 8              /* of Newton's method for the forces of a contact, before each is found alone */
#define ROUGH 3e-7            /* largest last change of them, over their scale: about its square is left */
#define SMALL 1e-30           /* um, 1: of what may be 0 in both parts of a quotient */
#define FAR 1e9               /* um, a motion by which every contact slips */
#define REMEMBERED 1e-6       /* share of the force after a period, above which it is remembered for many periods */
#define FORGOTTEN 1e-12       /* share of the force that the compression in series remembers no more */
#define SOLVED 0.1            /* error of Newton's method, over that of a step */
#define ITERATIONS 8          /* with one Jacobian matrix */
#define SLOW 0.3              /* a change over the one before it, above which the Jacobian matrix is old */
#define FAST 0.02             /* smallest such ratio that is kept: a smaller one is chance */
#define AGES 1.1              /* growth of that ratio where it is not measured */
/* Error of second order over the one that a step may have, below which the state is that of second order, and guesses are the
   present state. A state of third order has a rate by the Jacobian matrix: where that is old, long steps would not settle */
#define QUIET 0.1
#define LONGER 4.0            /* a step over the one before it, up to which guesses go on from that one */
#define SHORTEST 0.25         /* of a period of the drive: the shortest step whose error counts */
#define HALVINGS 12           /* of the shortest step, if its equations are not solved */
#define MIDDLE 0.58578643762690495 /* 2 - sqrt(2): end of the trapezoidal part of a step */
#define WEIGHT 0.29289321881345248 /* 1 - 1/sqrt(2): of the rate at the end of a stage, in both stages */
#define SHARE 0.35355339059327376  /* sqrt(2)/4: of the rates at begin and middle, in the second stage */

/* A function that is compiled twice, with all that it calls, where the loader can choose: on a processor with AVX2 its vectors
   have four numbers instead of two. The results are equal in every bit. */
#if defined __GNUC__ && !defined __clang__ && defined __GLIBC__ && defined __x86_64__
#define VECTORS __attribute__((flatten, target_clones("avx2", "default")))
#else
#define VECTORS
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
static phasor turned_by(double degrees) { return (phasor){cos(degrees * PI / 180.0), sin(degrees * PI / 180.0)}; }

/* --- the contact --- */

struct contact { /* one of them */
    phasor fx[ORDERS], fy[ORDERS]; /* N, force on the tip; [0] is the mean */
    double normal, friction;       /* N, means */
    double separated, slip;        /* shares of the period */
    double shift, low, high;       /* um: motion and limits of the slider over the period, for clip_slider() */
};

#if NORMAL_ROOT || FRICTION_ROOT
/* The root of an equation whose right side falls as the value rises, from a value, with the share of the first change from the
   last root: secants, and halves of the interval where they leave it. The last secant is not evaluated: its error is a part of
   the product of the two errors before it. The scale of small forces is a tenth of the preload. */
static inline double falling_root(double (*right)(struct phase *, double), struct phase *p, double now, double *known_share)
{
    double next = now, low = now, high = now, end = now, before = now, last = 0.0;
    double share = *known_share > 0.0 ? *known_share : 1.0;

    for (int i = 0; i < 100; i++) {
        double found = right(p, now), excess = found - now, scale = fabs(now) + 0.1 * p->preload;
        if (i == 0)
            end = found, low = smaller(now, found), high = larger(now, found);
        else
            share = (now - before) / (last - excess);
        if (excess > 0.0)
            low = now;
        else
            high = now;
        next = now + share * excess;
        if (fabs(excess) <= 1e-13 * scale || (i > 0 && fabs(excess * last) <= 1e-13 * scale * scale)) {
            next = smaller(larger(next, low), high);
            break;
        }
        if (!(next > low && next < high) && (i != 1 || next != end)) /* the root of a constant is the end */
            next = 0.5 * (low + high);
        before = now, last = excess, now = next;
    }
    *known_share = share > 0.0 && share <= 1.0 ? share : 1.0;
    return next;
}
#endif

/* Sum the harmonics of a displacement at every phase, and at those before the first and behind the last, in um. */
static void synthesise(const struct motor *m, const phasor part[HARMONICS + 1], double at[PHASES + 2])
{
    for (int n = 0; n < PHASES; n++) {
        double found = part[0].re;
        for (int h = 1; h <= HARMONICS; h++)
            found += part[h].re * m->wheel[n][h].re - part[h].im * m->wheel[n][h].im;
        at[n + 1] = 1e6 * found;
    }
    at[0] = at[PHASES];
    at[PHASES + 1] = at[1];
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

/* What the contact depends on. */
struct path {
    phasor x[HARMONICS + 1], y[HARMONICS + 1]; /* m, mean and harmonics of the tip; x is measured from the crown */
    double slider, speed;                      /* m at the begin of the period; rad/s against the carrier */
    double frequency;                          /* Hz */
};

/* The preload for which the distance of stator and rotor is set. A mount keeps that of the rest, and its springs press with
   the present preload; without a mount another preload is another distance. */
static double laid_preload(const struct motor *m) { return MOUNTED ? m->laid : m->value.preload; }

/* What each of several contacts has. */
static struct seat seat_of(const struct values *p, int contact)
{
#if CONTACTS > 1
    return p->seat[contact];
#else
    (void)p, (void)contact;
    return (struct seat){.share = 1.0, .friction_ratio = 1.0, .direction = 1.0};
#endif
}

/* The motion of a contact by a mode, or by the carrier towards and along the rotor. */
static struct tip tip_of(const struct values *p, int contact, int number)
{
    if (number >= MODES)
        return number == MODES ? (struct tip){0.0, 1.0} : (struct tip){seat_of(p, contact).direction, 0.0};
#if CONTACTS > 1
    if (contact > 0)
        return p->tip[contact - 1][number];
#endif
    return (struct tip){p->mode[number].tip_x, p->mode[number].tip_y};
}

/* The bending of a mode, m, away from the rotor, under a static preload, N. */
static double bent(const struct values *p, int mode, double preload)
{
    double force = 0.0;

    for (int c = 0; c < CONTACTS; c++)
        force += tip_of(p, c, mode).tip_y * (seat_of(p, c).share * preload);
    return force / p->mode[mode].stiffness;
}

/* The penetration of the first contact under the preload, m. */
static double static_penetration(const struct values *p)
{
    return pow(seat_of(p, 0).share * p->preload / p->normal_stiffness, 1.0 / EXPONENT);
}

/* The slider in m at the end of a period, from that at its beginning. At each phase it moves with the tip and is clipped at
   the limits of stick; all phases together are one motion and one pair of limits. */
static double clip_slider(const struct contact *c, double slider)
{
    return 1e-6 * fmin(fmax(1e6 * slider + c->shift, c->low), c->high);
}

/* A period of a contact, phase by phase. */
struct lap {
    double x[PHASES + 2], y[PHASES + 2]; /* um, from the last phase of the period before to the first of the next */
    double normal[PHASES + 2];           /* N, from the last phase but one of the period before */
    double hold[PHASES];                 /* factor of the normal force by the damping */
    double limit[PHASES], motion[PHASES], bound[PHASES], before[PHASES]; /* um, of the slider; before is where it was */
    double most[PHASES], far[PHASES];    /* N, um: friction and slider where all slips */
    double steep[PHASES];                /* slope of the friction by itself, over what is left of the limit^(EXPONENT - 1) */
    double friction[PHASES];             /* N */
    double fx[PHASES], fy[PHASES], open[PHASES], slip[PHASES];
};

/* The approach at a phase, for the normal forces at this phase and those before. */
static inline struct phase approaching(const struct phase *every, const struct lap *l, int n)
{
    struct phase at = *every;

    at.x_before = l->x[n], at.x = l->x[n + 1], at.x_after = l->x[n + 2];
    at.y_before = l->y[n], at.y = l->y[n + 1], at.y_after = l->y[n + 2];
    at.normal_earlier = l->normal[n], at.normal_before = l->normal[n + 1], at.normal = l->normal[n + 2];
    phase_approach(&at);
    return at;
}

/* The loops over the phases have no branches, so that compilers find vectors in them. */
#if NORMAL_ROOT
/* Improve the normal forces by Newton's method, at all phases at once, for a period that ends as the one before; return whether
   it ends, and the compression in series remembers no force for a period. So many phases before remember it: from the first of
   them, which is in the period before, each change adds to the next two. */
static int solved_normal(const struct phase *every, struct lap *l, double phases)
{
    double change[PHASES], memory[PHASES], scale = 0.1 * every->preload;

    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double before = 0.0, earlier = 0.0;
        int rough = 0;
        l->normal[0] = l->normal[PHASES], l->normal[1] = l->normal[PHASES + 1];
        for (int n = 0; n < PHASES; n++) {
            struct phase at = approaching(every, l, n);
            double now = at.normal, found = phase_normal_by(&at, now);
            phase_motion(&at);
            /* slope of the right side: -spring / depth - 3 delay / hold; by the forces before: 4 and -1 delay / hold */
            double depth = larger(at.depth, SMALL), hold = larger(at.hold, SMALL);
            double spring = 1e6 * EXPONENT * at.series * found, delay = at.damping * at.series * at.rate * found;
            double share = 1.0 / (depth * hold + spring * hold + 3.0 * delay * depth);
            change[n] = share * depth * hold * (found - now);
            memory[n] = share * depth * delay;
        }
        for (int k = -(int)smaller(phases, PHASES / 2); k < PHASES; k++) {
            int n = k < 0 ? k + PHASES : k;
            double whole = change[n] - memory[n] * earlier + 4.0 * memory[n] * before;
            earlier = before, before = whole;
            if (k >= 0)
                change[n] = whole;
        }
        for (int n = 0; n < PHASES; n++) {
            double now = l->normal[n + 2];
            l->normal[n + 2] = larger(now + change[n], 0.0);
            rough += !(fabs(change[n]) <= ROUGH * (now + scale));
        }
        if (rough)
            continue;
        l->normal[0] = l->normal[PHASES], l->normal[1] = l->normal[PHASES + 1];
        before = earlier = phases > PHASES ? 1.0 : 0.0;
        for (int n = 0; n < PHASES && (before != 0.0 || earlier != 0.0); n++) {
            double whole = 4.0 * memory[n] * before - memory[n] * earlier;
            earlier = before, before = whole;
        }
        return fabs(before) <= REMEMBERED;
    }
    return 0;
}
#endif

#if FRICTION_ROOT
/* A phase of which the friction force is to be found. */
static inline struct phase rubbing(const struct phase *every, const struct lap *l, int n)
{
    struct phase at = *every;

    at.limit = l->limit[n], at.hold = l->hold[n], at.motion = l->motion[n], at.slider_before = l->before[n];
    phase_moved(&at);
    return at;
}

/* Improve the friction forces in the same way. */
static int solved_friction(const struct phase *every, struct lap *l)
{
    double change[PHASES], scale = 0.1 * every->preload;

    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        int rough = 0;
        for (int n = 0; n < PHASES; n++) {
            struct phase at = rubbing(every, l, n);
            double now = l->friction[n], found = phase_friction_by(&at, now);
            double left = larger(at.limit - fabs(at.moved - 1e6 * at.series_x * now), 0.0);
            change[n] = (found - now) / (1.0 + l->steep[n] * (EXPONENT == 1.5 ? sqrt(left) : pow(left, EXPONENT - 1.0)));
            l->friction[n] = now + change[n];
        }
        for (int n = 0; n < PHASES; n++)
            rough += !(fabs(change[n]) <= ROUGH * (fabs(l->friction[n]) + scale));
        if (!rough)
            return 1;
    }
    return 0;
}
#endif

/* Find the normal forces of a period. So many phases remember a force; the compression that remembers one for more than a period
   begins at that of rest. */
static void press(const struct phase *every, struct lap *l, double phases, const struct guess *guess)
{
#if NORMAL_ROOT
    memcpy(l->normal + 2, guess->normal, sizeof guess->normal);
    if (!solved_normal(every, l, phases)) {
        double share = 0.0, before = every->preload, earlier = before;
        for (int k = -(int)smaller(phases, PHASES / 2); k < PHASES; k++) {
            int n = k < 0 ? k + PHASES : k;
            l->normal[n] = earlier, l->normal[n + 1] = before;
            struct phase at = approaching(every, l, n);
            earlier = before;
            before = l->normal[n + 2] = falling_root(phase_normal_by, &at, guess->normal[n], &share);
        }
    }
#else
    (void)phases, (void)guess;
    memset(l->normal, 0, sizeof l->normal); /* none is remembered */
    for (int n = 0; n < PHASES; n++) {
        struct phase at = approaching(every, l, n);
        l->normal[n + 2] = phase_normal_by(&at, 0.0);
    }
#endif
}

/* Find the friction forces of a period from where the slider was before each phase. */
static void rub(const struct phase *every, struct lap *l, const struct guess *guess)
{
#if FRICTION_ROOT
    memcpy(l->friction, guess->friction, sizeof guess->friction);
    if (!solved_friction(every, l)) {
        double share = 0.0;
        for (int n = 0; n < PHASES; n++) {
            struct phase at = rubbing(every, l, n);
            l->friction[n] = falling_root(phase_friction_by, &at, guess->friction[n], &share);
        }
    }
#else
    (void)guess;
#endif
    for (int n = 0; n < PHASES; n++) {
        struct phase at = approaching(every, l, n);
        phase_motion(&at);
        at.slider_before = l->before[n];
        phase_moved(&at);
        at.friction = l->friction[n] = FRICTION_ROOT ? l->friction[n] : phase_friction_by(&at, 0.0);
        phase_forces(&at);
        l->fx[n] = at.fx;
        l->fy[n] = at.fy;
        l->open[n] = at.open;
        l->slip[n] = at.slip;
    }
}

/* One period of a contact; piezomotor_phase.h takes displacements in um. */
VECTORS static struct contact touch(struct motor *m, int contact, const struct path *path)
{
    const struct values *v = &m->value;
    const struct touching *p = &v->contact[contact];
    struct guess *guess = &m->guess[contact];
    struct seat seat = seat_of(v, contact);
    struct lap l;
    double deflection = seat.height, preload = laid_preload(m), slider = 1e6 * path->slider;
    struct contact found = {.low = -INFINITY, .high = INFINITY};

    for (int i = 0; i < MODES; i++)
        deflection += tip_of(v, contact, i).tip_y * bent(v, i, preload);
    struct phase every = {
        .normal_stiffness = p->normal_stiffness, .compliance = p->compliance, .mu = seat.friction_ratio * v->friction, .radius = p->radius,
        .sliding = p->sliding_ratio, .stribeck = p->stribeck_velocity, .preload = seat.share * preload, .deflection = 1e6 * deflection,
        .damping = p->normal_damping, .series = p->series_compliance, .series_x = p->series_compliance_x,
        .turn = 1e6 * p->radius * path->speed / (PHASES * path->frequency), .rate = 0.5 * PHASES * path->frequency,
    };
    phase_parameters(&every);

    synthesise(m, path->x, l.x);
    synthesise(m, path->y, l.y);
    /* The compression in series remembers the force: phases of the period before find what it was. An error of the force E
       of the spring remains to at most 5 Q/(1 + 3 Q) in the next phase, Q = damping * series * rate * E; the number of phases
       is that after which FORGOTTEN remains. With 20 times the damping and 10 times the compliance of bimodal40, half a period
       is the result of ten periods to seven digits */
    double phases = 0.0;
    if (p->normal_damping > 0.0 && p->series_compliance > 0.0) {
        double top = l.y[1];
        for (int n = 2; n <= PHASES; n++)
            top = larger(top, l.y[n]);
        double force = p->normal_stiffness * pow(1e-6 * fmax(every.seat + top, 0.0), EXPONENT);
        double memory = p->normal_damping * p->series_compliance * every.rate * force;
        double left = fmin(5.0 * memory / (1.0 + 3.0 * memory), 0.999);
        phases = left > 0.0 ? ceil(log(FORGOTTEN) / log(left)) : 0.0;
    }
    press(&every, &l, phases, guess);
    for (int n = 0; n < PHASES; n++) {
        struct phase at = approaching(&every, &l, n);
        phase_motion(&at);
        l.motion[n] = at.motion;
        l.bound[n] = at.bound;
        at.slider_before = FAR;
        phase_moved(&at);
        at.friction = l.most[n] = phase_friction_by(&at, 0.0);
        phase_forces(&at);
        l.far[n] = at.slider;
#if FRICTION_ROOT
        double limit = larger(at.limit, SMALL);
        l.limit[n] = at.limit;
        l.hold[n] = at.hold;
        l.steep[n] = 1e6 * EXPONENT * at.series_x * at.friction / (EXPONENT == 1.5 ? limit * sqrt(limit) : pow(limit, EXPONENT));
#endif
    }
    for (int n = 0; n < PHASES; n++) {
        l.before[n] = slider;
        slider = smaller(larger(slider + l.motion[n], -l.far[n]), l.far[n]);
        found.shift += l.motion[n];
        found.low = smaller(larger(found.low + l.motion[n], -l.bound[n]), l.bound[n]);
        found.high = smaller(larger(found.high + l.motion[n], -l.bound[n]), l.bound[n]);
    }
    rub(&every, &l, guess);
    for (int n = 0; n < PHASES; n++) {
        double normal = l.normal[n + 2], friction = l.friction[n];
        if (isfinite(normal) && isfinite(friction))
            guess->normal[n] = normal, guess->friction[n] = friction;
        found.normal += normal / PHASES;
        found.friction += friction / PHASES;
        found.separated += l.open[n] / PHASES;
        found.slip += l.slip[n] / PHASES;
    }
    analyse(m, l.fx, found.fx);
    analyse(m, l.fy, found.fy);
    return found;
}

/* --- the motor --- */

static double natural(const struct mode *mode) { return sqrt(mode->stiffness / mode->mass); } /* rad/s */

/* Factor of the rate of an amplitude in its equation of motion: c + j m (omega + omega_0). */
static phasor inertance(const struct mode *mode, double omega)
{
    return (phasor){mode->damping, mode->mass * (omega + natural(mode))};
}

/* Factor of the rate of an amplitude whose free motion is exp(-from * t). The averages do not describe an oscillation at half
   of the drive's frequency or more: with the factor the amplitude settles without oscillation. A slow motion changes at most
   by the fourth power of the ratio. */
static phasor settling(phasor from, double frequency)
{
    double ratio = size(from) / (PI * frequency), damped = ratio * ratio * ratio * ratio;
    phasor straight = scaled(ratio * ratio * ratio / (PI * frequency), (phasor){from.re, -from.im}); /* from * straight is real */

    return scaled(1.0 / (1.0 + damped), (phasor){1.0 + straight.re, straight.im});
}

struct flow {
    double rate[STATES];
    phasor current_a, current_b; /* A */
    double heat, contact_power;  /* W */
    double stored;               /* J, in the modes and the clamped capacitances */
    phasor push, velocity;       /* of the mode that a loop follows: force of the groups, N; velocity, m/s */
    struct contact contact[CONTACTS];
};

/* Temperature of the stator above that at which the parameters hold. */
static double stator_temperature(const struct values *p, const double state[STATES])
{
    return p->heat_capacity > 0.0 ? state[TEMPERATURE] : p->ambient_temperature;
}

/* A mode, or the carrier towards and along the rotor, which the drive does not move. */
static struct mode moving(const struct values *p, int number)
{
    if (number < MODES)
        return p->mode[number];
    if (number == MODES)
        return (struct mode){.mass = p->mount_mass, .damping = p->mount_damping, .stiffness = p->mount_stiffness};
    return (struct mode){.mass = p->mount_x_mass, .damping = p->mount_x_damping, .stiffness = p->mount_x_stiffness};
}

/* The place of an amplitude among the states. */
static int place(int mode, int harmonic) { return AMPLITUDE + 2 * (HARMONICS * mode + harmonic - 1); }

/* The frequency of the drive, Hz: the input, or that of the oscillator of a loop. */
static double drive_frequency(const struct motor *m, const double state[STATES])
{
#if TRACKED
    struct tracker at = m->tracker;

    at.tuning = state[LOOP];
    tracker_flows(&at);
    return at.frequency;
#else
    (void)state;
    return m->value.frequency;
#endif
}

/* The amplitude of the voltage of the stage of a group, V. */
static phasor stage(const struct values *p, int group)
{
    return group == 0 ? (phasor){p->amplitude_a, 0.0} : scaled(p->amplitude_b, turned_by(p->phase));
}

/* The amplitude of the voltage of a group, V: that of the stage, or behind a network a state. */
static phasor voltage(const struct motor *m, const double state[STATES], int group)
{
#if DRIVEN
    const double *own = state + NETWORK + 8 * group + 6;

    return (phasor){own[0], own[1]};
#else
    (void)state;
    return stage(&m->value, group);
#endif
}

/* Find the path of the tip at each contact: the sum of the modes; x from the crown of the rotor, which is above the tip at rest;
   y with the carrier. */
static void find_paths(const struct motor *m, const double state[STATES], struct path paths[CONTACTS])
{
    const struct values *p = &m->value;
    double laid = laid_preload(m), frequency = drive_frequency(m, state), rest[MODES];
    phasor u_a = voltage(m, state, 0), u_b = voltage(m, state, 1);

    for (int i = 0; i < MODES; i++)
        rest[i] = bent(p, i, laid);
    for (int c = 0; c < CONTACTS; c++) {
        double along = seat_of(p, c).direction;
        struct path found = {
            .slider = state[SLIDER + c], .frequency = frequency,
            .speed = state[SPEED] - along * state[CARRIER_X_VELOCITY] / p->contact[c].radius,
        };
        for (int i = 0; i < MODES; i++) {
            struct tip tip = tip_of(p, c, i);
            found.x[0].re += tip.tip_x * (state[DEFLECTION + i] + rest[i]);
            found.y[0].re += tip.tip_y * state[DEFLECTION + i];
        }
        for (int i = 0; i < MOVING; i++) {
            struct tip tip = tip_of(p, c, i);
            for (int h = 1; h <= HARMONICS; h++) {
                phasor amplitude = {state[place(i, h)], state[place(i, h) + 1]};
                found.x[h] = sum(found.x[h], scaled(tip.tip_x, amplitude));
                found.y[h] = sum(found.y[h], scaled(tip.tip_y, amplitude));
            }
        }
        if (c == 0) { /* modes that are left out move the first contact only */
            found.x[1] = sum(found.x[1], sum(scaled(p->motion_x_a, u_a), scaled(p->motion_x_b, u_b)));
            found.y[1] = sum(found.y[1], sum(scaled(p->motion_y_a, u_a), scaled(p->motion_y_b, u_b)));
        }
        found.x[0].re += along * state[CARRIER_X];
        found.y[0].re += state[CARRIER];
        paths[c] = found;
    }
}

/* The force of all contacts on a mode, or on the carrier, N: the mean or a harmonic. */
static phasor modal_force(const struct values *p, const struct contact contact[CONTACTS], int number, int harmonic)
{
    phasor found = {0.0, 0.0};

    for (int c = 0; c < CONTACTS; c++) {
        struct tip tip = tip_of(p, c, number);
        phasor force = sum(scaled(tip.tip_x, contact[c].fx[harmonic]), scaled(tip.tip_y, contact[c].fy[harmonic]));
        found = c > 0 ? sum(found, force) : force;
    }
    return found;
}

/* Find the rates of rotor and load for the torque on the rotor. */
static void turn(const struct values *p, const double state[STATES], double torque, double rate[STATES])
{
    int rigid = p->coupling_stiffness == 0.0;
    double angle = state[rigid ? POSITION : LOAD_POSITION], speed = state[rigid ? SPEED : LOAD_SPEED];
    double resisted = p->load_damping * speed + p->load_spring * angle
        + p->load_gravity * sin(angle + p->load_angle * PI / 180.0);

    rate[POSITION] = rate[LOAD_POSITION] = state[SPEED];
    if (p->load_inertia == 0.0 || rigid) {
        rate[SPEED] = rate[LOAD_SPEED] = (torque - (p->load_inertia > 0.0 ? resisted : 0.0)) / (p->inertia + p->load_inertia);
        return;
    }
    double twist = state[POSITION] - state[LOAD_POSITION], play = 0.5 * p->backlash;
    double wound = twist > play ? twist - play : twist < -play ? twist + play : 0.0;
    double passed = p->coupling_stiffness * wound + p->coupling_damping * (state[SPEED] - state[LOAD_SPEED]);
    if (passed * wound <= 0.0) /* a coupling with play does not pull its sides together */
        passed = p->backlash > 0.0 ? 0.0 : passed;
    rate[LOAD_POSITION] = state[LOAD_SPEED];
    rate[LOAD_SPEED] = (passed - resisted) / p->load_inertia;
    rate[SPEED] = (torque - passed) / p->inertia;
}

/* Add the currents that change the charges of the clamped capacitances; behind networks also find the rates of these. */
static void charge(const struct motor *m, const double state[STATES], double frequency, struct flow *f)
{
    const struct values *p = &m->value;
    phasor rise_a, rise_b; /* V/s */
#if DRIVEN
    phasor left[2] = {scaled(-1.0, f->current_a), scaled(-1.0, f->current_b)}; /* A, for the capacitances */
    double whole[2] = {p->capacitance_a, p->capacitance_b};

    for (int g = 0; g < 2; g++) {
        const double *own = state + NETWORK + 8 * g;
        double *rate = f->rate + NETWORK + 8 * g;
        struct network at = m->network[g];
        phasor u = stage(p, g);
        at.frequency = frequency, at.in_re = u.re, at.in_im = u.im;
        at.i_re = own[0], at.i_im = own[1], at.p_re = own[2], at.p_im = own[3];
        at.c_re = own[4], at.c_im = own[5], at.out_re = own[6], at.out_im = own[7];
        network_flows(&at);
        rate[0] = at.flow_i_re / at.store_i_re, rate[1] = at.flow_i_im / at.store_i_im;
        rate[2] = at.flow_p_re / at.store_p_re, rate[3] = at.flow_p_im / at.store_p_im;
        rate[4] = at.flow_c_re / at.store_c_re, rate[5] = at.flow_c_im / at.store_c_im;
        left[g] = sum(left[g], (phasor){at.flow_out_re, at.flow_out_im});
        whole[g] += at.store_out_re;
    }
    double between = p->capacitance_ab, square = whole[0] * whole[1] - between * between;
    rise_a = scaled(1.0 / square, sum(scaled(whole[1], left[0]), scaled(between, left[1])));
    rise_b = scaled(1.0 / square, sum(scaled(whole[0], left[1]), scaled(between, left[0])));
    f->rate[NETWORK + 6] = rise_a.re, f->rate[NETWORK + 7] = rise_a.im;
    f->rate[NETWORK + 14] = rise_b.re, f->rate[NETWORK + 15] = rise_b.im;
#else
    double turning = m->slope[phase_place] * PI / 180.0;

    (void)state, (void)frequency;
    rise_a = (phasor){m->slope[amplitude_a_place], 0.0};
    rise_b = product((phasor){m->slope[amplitude_b_place], p->amplitude_b * turning}, turned_by(p->phase));
#endif
    f->current_a = sum(f->current_a, sum(scaled(p->capacitance_a, rise_a), scaled(-p->capacitance_ab, rise_b)));
    f->current_b = sum(f->current_b, sum(scaled(p->capacitance_b, rise_b), scaled(-p->capacitance_ab, rise_a)));
}

/* Find the rate, m/s, at which the tip at a contact moves on the carrier along the rotor from one period to the next, at the last phase, where
   the slider is carried over. The speed of the path has that of the carrier. */
static double creep(const struct motor *m, int contact, const double rate[STATES])
{
    const phasor *last = m->wheel[PHASES - 1];
    double found = 0.0;

    for (int i = 0; i < MODES; i++)
        found += tip_of(&m->value, contact, i).tip_x * rate[DEFLECTION + i];
    for (int i = 0; i < MOVING; i++)
        for (int h = 1; h <= HARMONICS; h++) {
            const double *amplitude = rate + place(i, h);
            found += tip_of(&m->value, contact, i).tip_x * (amplitude[0] * last[h].re - amplitude[1] * last[h].im);
        }
    return found;
}

/* Find the rates of the states, and what the outputs need, for the contacts in f. */
static void respond(const struct motor *m, const double state[STATES], struct flow *f)
{
    const struct values *p = &m->value;
    phasor u_a = voltage(m, state, 0), u_b = voltage(m, state, 1);
    double warm = stator_temperature(p, state), frequency = drive_frequency(m, state);
    double gain = 1.0 + p->coupling_drift * warm, drift = 1.0 + p->frequency_drift * warm;

    /* groups: clamped capacitances with a constant loss tangent */
    double susceptance = 2.0 * PI * frequency * (1.0 + p->capacitance_drift * warm)
        * pow(REFERENCE / frequency, 2.0 / PI * atan(p->loss));
    phasor admittance = {susceptance * p->loss, susceptance};
    phasor q_a = sum(scaled(p->capacitance_a, u_a), scaled(-p->capacitance_ab, u_b));
    phasor q_b = sum(scaled(p->capacitance_b, u_b), scaled(-p->capacitance_ab, u_a));
    f->current_a = product(admittance, q_a);
    f->current_b = product(admittance, q_b);
    f->stored = 0.25 * (q_a.re * u_a.re + q_a.im * u_a.im + q_b.re * u_b.re + q_b.im * u_b.im);
    f->contact_power = 0.0;
    f->heat = 0.5 * admittance.re * (q_a.re * u_a.re + q_a.im * u_a.im + q_b.re * u_b.re + q_b.im * u_b.im);

    /* modes */
    for (int i = 0; i < MODES; i++) {
        const struct mode *mode = &p->mode[i];
        double mean = modal_force(p, f->contact, i, 0).re;
        f->rate[DEFLECTION + i] = (mean / mode->stiffness - state[DEFLECTION + i]) / LAG;
    }
    for (int i = 0; i < MOVING; i++) {
        struct mode one = moving(p, i), *mode = &one;
        double stiffness = i < MODES ? mode->stiffness * drift * drift : mode->stiffness;
        for (int h = 1; h <= HARMONICS; h++) {
            int s = place(i, h);
            double omega = 2.0 * PI * h * frequency;
            phasor amplitude = {state[s], state[s + 1]};
            phasor spring = {stiffness - mode->mass * omega * omega, mode->damping * omega};
            phasor pushed = modal_force(p, f->contact, i, h), force = pushed;
            if (h == 1)
                force = sum(force, scaled(gain, sum(scaled(mode->coupling_a, u_a), scaled(mode->coupling_b, u_b))));
            force = sum(force, scaled(-1.0, product(spring, amplitude)));
            phasor inert = inertance(mode, omega);
            phasor rate = product(quotient(force, inert), settling(quotient(spring, inert), frequency));
            phasor velocity = sum(rate, scaled(omega, turned(amplitude)));
            f->rate[s] = rate.re;
            f->rate[s + 1] = rate.im;
            if (i < MODES) {
                f->heat += 0.5 * mode->damping * square(velocity);
                f->contact_power -= 0.5 * (pushed.re * velocity.re + pushed.im * velocity.im);
                f->stored += 0.25 * (mode->mass * square(velocity) + mode->stiffness * square(amplitude));
            }
            if (h == 1) {
                f->current_a = sum(f->current_a, scaled(gain * mode->coupling_a, velocity));
                f->current_b = sum(f->current_b, scaled(gain * mode->coupling_b, velocity));
            }
        }
    }

    /* modes that are left out: the force on the tip moves the charges S F of the groups */
    phasor fx = f->contact[0].fx[1], fy = f->contact[0].fy[1];
    phasor pressed_a = sum(scaled(p->motion_x_a, fx), scaled(p->motion_y_a, fy));
    phasor pressed_b = sum(scaled(p->motion_x_b, fx), scaled(p->motion_y_b, fy));
    phasor drawn_a = scaled(2.0 * PI * frequency, turned(pressed_a)), drawn_b = scaled(2.0 * PI * frequency, turned(pressed_b));
    f->current_a = sum(f->current_a, drawn_a);
    f->current_b = sum(f->current_b, drawn_b);
    f->contact_power += 0.5 * (u_a.re * drawn_a.re + u_a.im * drawn_a.im + u_b.re * drawn_b.re + u_b.im * drawn_b.im);

    charge(m, state, frequency, f);

    /* carrier, rotor, slider, temperature */
    double torque = 0.0, pressed = 0.0, along = 0.0; /* N.m, N: of all contacts */
    for (int c = 0; c < CONTACTS; c++) {
        torque += p->contact[c].radius * f->contact[c].friction;
        pressed += f->contact[c].fy[0].re;
        along += seat_of(p, c).direction * f->contact[c].fx[0].re;
    }
    double push = p->preload + pressed - p->mount_stiffness * state[CARRIER]
        - p->mount_damping * state[CARRIER_VELOCITY];
    double push_x = along - p->mount_x_stiffness * state[CARRIER_X]
        - p->mount_x_damping * state[CARRIER_X_VELOCITY];
    double drive = torque - p->load_torque - p->bearing * state[SPEED]
        - p->bearing_friction * state[BEARING];
    f->rate[CARRIER] = state[CARRIER_VELOCITY];
    f->rate[CARRIER_VELOCITY] = MOUNTED ? push / p->mount_mass : 0.0;
    f->rate[CARRIER_X] = state[CARRIER_X_VELOCITY];
    f->rate[CARRIER_X_VELOCITY] = MOUNTED_X ? push_x / p->mount_x_mass : 0.0;
    turn(p, state, drive, f->rate);
    f->rate[BEARING] = (state[SPEED] - state[BEARING] * fabs(state[SPEED])) / p->bearing_presliding; /* Dahl */
    /* the tip takes the slider along; what slips in the period that follows sets it anew */
    for (int c = 0; c < CONTACTS; c++) {
        double slider = state[SLIDER + c];
        f->rate[SLIDER + c] = frequency * (clip_slider(&f->contact[c], slider + creep(m, c, f->rate) / frequency) - slider);
    }
    f->rate[TEMPERATURE] = 0.0;
    if (p->heat_capacity > 0.0) {
        double cooling = (warm - p->ambient_temperature) / p->thermal_resistance;
        f->rate[TEMPERATURE] = (f->heat - cooling) / p->heat_capacity;
    }
    f->rate[CHARGE] = f->current_a.re;
    f->rate[CHARGE + 1] = f->current_a.im;
    f->rate[CHARGE + 2] = f->current_b.re;
    f->rate[CHARGE + 3] = f->current_b.im;
#if TRACKED
    const struct mode *mode = &p->mode[m->followed];
    const double *of = state + place(m->followed, 1), *rate = f->rate + place(m->followed, 1);
    struct tracker at = m->tracker;
    f->push = sum(scaled(mode->coupling_a, u_a), scaled(mode->coupling_b, u_b));
    f->velocity = sum((phasor){rate[0], rate[1]}, scaled(2.0 * PI * frequency, turned((phasor){of[0], of[1]})));
    at.tuning = at.out = state[LOOP], at.inner = state[LOOP + 1], at.timer = state[LOOP + 2], at.restart = state[LOOP + 3];
    at.target = p->target, at.temperature = warm;
    at.a_re = u_a.re, at.a_im = u_a.im, at.b_re = u_b.re, at.b_im = u_b.im;
    at.vline_a_re = f->current_a.re, at.vline_a_im = f->current_a.im;
    at.vline_b_re = f->current_b.re, at.vline_b_im = f->current_b.im;
    tracker_flows(&at);
    f->rate[LOOP] = at.flow_out / at.store_out;
    f->rate[LOOP + 1] = at.flow_inner / at.store_inner;
    f->rate[LOOP + 2] = at.flow_timer / at.store_timer;
    f->rate[LOOP + 3] = at.flow_restart / at.store_restart;
#endif
}

/* Evaluate the motor in some state. */
static void evaluate(struct motor *m, const double state[STATES], struct flow *f)
{
    struct path paths[CONTACTS];

    find_paths(m, state, paths);
    for (int c = 0; c < CONTACTS; c++)
        f->contact[c] = touch(m, c, &paths[c]);
    respond(m, state, f);
}

/* The motion that the harmonics left out would cause, relative to the static penetration and the limit of stick; of several
   contacts at the one that moves most. */
static double check(const struct values *p, const struct contact contact[CONTACTS])
{
    double depth = static_penetration(p), largest = 0.0;
    double limit = seat_of(p, 0).friction_ratio * p->friction * p->compliance * pow(p->normal_stiffness, 1.0 / EXPONENT) * depth;
    phasor moved[MOVING][ORDERS];

    for (int h = HARMONICS + 1; h < ORDERS; h++) {
        double omega = 2.0 * PI * h * p->frequency;
        for (int i = 0; i < MOVING; i++) {
            struct mode one = moving(p, i), *mode = &one;
            phasor spring = {mode->stiffness - mode->mass * omega * omega, mode->damping * omega};
            moved[i][h] = quotient(modal_force(p, contact, i, h), spring);
        }
    }
    for (int c = 0; c < CONTACTS; c++) {
        double total = 0.0;
        for (int h = HARMONICS + 1; h < ORDERS; h++) {
            phasor x = {0.0, 0.0}, y = {0.0, 0.0};
            for (int i = 0; i < MOVING; i++) {
                struct tip tip = tip_of(p, c, i);
                x = sum(x, scaled(tip.tip_x, moved[i][h]));
                y = sum(y, scaled(tip.tip_y, moved[i][h]));
            }
            total += square(x) / (limit * limit) + square(y) / (depth * depth);
        }
        largest = fmax(largest, total);
    }
    return sqrt(largest);
}

/* --- what others call --- */

void motor_default(struct motor *motor)
{
    /* inputs, outputs (0), parameters, in the order of struct values */
    static const double start[sizeof motor->value / sizeof(double)] = START;

    memcpy(&motor->value, start, sizeof start);
    for (int n = 0; n < PHASES; n++)
        for (int h = 0; h < ORDERS; h++)
            motor->wheel[n][h] = (phasor){cos(2.0 * PI * h * n / PHASES), sin(2.0 * PI * h * n / PHASES)};
    memset(motor->slope, 0, sizeof motor->slope);
    motor->longest = INFINITY;
    motor_rest(motor);
}

void motor_rest(struct motor *motor)
{
    const struct values *p = &motor->value;

    motor->laid = p->preload;
    memset(motor->state, 0, sizeof motor->state);
    memset(motor->flux, 0, sizeof motor->flux);
    motor->step = motor_shortest_step(motor);
    motor->solver = (struct solver){0};
    memset(motor->guess, 0, sizeof motor->guess);
    for (int i = 0; i < MODES; i++)
        motor->state[DEFLECTION + i] = -bent(p, i, p->preload);
    motor->state[TEMPERATURE] = p->ambient_temperature;
#if TRACKED
    motor->state[LOOP] = motor->state[LOOP + 1] = motor->tracker.start;
#endif
    motor_measure(motor);
}

void motor_measure(struct motor *motor)
{
    struct values *p = &motor->value;
    struct flow flow;
    phasor back = turned_by(-p->phase); /* turns a phase to that ahead of group B */

    evaluate(motor, motor->state, &flow);
    phasor current_b = product(flow.current_b, back);
    p->frequency = drive_frequency(motor, motor->state);
    p->speed = motor->state[SPEED];
    p->position = motor->state[POSITION];
    p->load_speed = motor->state[LOAD_SPEED];
    p->load_position = motor->state[LOAD_POSITION];
    p->current_amplitude_a = size(flow.current_a);
    p->current_phase_a = 180.0 / PI * atan2(flow.current_a.im, flow.current_a.re);
    p->current_amplitude_b = size(current_b);
    p->current_phase_b = 180.0 / PI * atan2(current_b.im, current_b.re);
    p->temperature = stator_temperature(p, motor->state);
    p->check = check(p, flow.contact);
    p->separated = p->slip = p->torque = p->normal_force = 0.0;
    for (int c = 0; c < CONTACTS; c++) { /* equal points have equal shares of the preload */
        p->separated += seat_of(p, c).share * flow.contact[c].separated;
        p->slip += seat_of(p, c).share * flow.contact[c].slip;
        p->torque += p->contact[c].radius * flow.contact[c].friction;
        p->normal_force += flow.contact[c].normal;
    }
    phasor u_a = voltage(motor, motor->state, 0), u_b = voltage(motor, motor->state, 1);
    p->electrical_power = 0.5 * (u_a.re * flow.current_a.re + u_a.im * flow.current_a.im)
        + 0.5 * (u_b.re * flow.current_b.re + u_b.im * flow.current_b.im);
    p->heat = flow.heat;
    p->contact_power = flow.contact_power;
    p->stored_energy = flow.stored;
    struct path paths[CONTACTS];
    find_paths(motor, motor->state, paths);
    p->tip_x_amplitude = p->tip_y_amplitude = 0.0;
    for (int c = 0; c < CONTACTS; c++) { /* of the contact that moves most */
        p->tip_x_amplitude = fmax(p->tip_x_amplitude, size(paths[c].x[1]));
        p->tip_y_amplitude = fmax(p->tip_y_amplitude, size(paths[c].y[1]));
    }
#if DRIVEN
    p->pin_amplitude_a = size(u_a);
    p->pin_amplitude_b = size(u_b);
    u_b = product(u_b, back);
    p->pin_phase_a = 180.0 / PI * atan2(u_a.im, u_a.re);
    p->pin_phase_b = 180.0 / PI * atan2(u_b.im, u_b.re);
#endif
#if TRACKED
    phasor ahead = product(flow.velocity, (phasor){flow.push.re, -flow.push.im});
    p->control = motor->state[LOOP];
    p->restart = motor->state[LOOP + 3];
    p->mode_phase = 180.0 / PI * atan2(ahead.im, ahead.re);
#endif
}

/* --- integration --- */

/* Find the scales of the states: the static penetration, and what moves the tip by it in a period. */
static void find_scales(const struct values *p, double scale[STATES])
{
    double depth = static_penetration(p);

    for (int s = 0; s < STATES; s++)
        scale[s] = depth;
    for (int i = 0; i < MODES; i++) {
        double most = 1e-6;
        for (int c = 0; c < CONTACTS; c++) {
            struct tip tip = tip_of(p, c, i);
            most = fmax(most, fmax(fabs(tip.tip_x), fabs(tip.tip_y)));
        }
        for (int s = place(i, 1); s < place(i + 1, 1); s++)
            scale[s] = depth / most;
    }
    scale[POSITION] = scale[LOAD_POSITION] = depth / p->radius;
    scale[SPEED] = scale[LOAD_SPEED] = scale[POSITION] * p->frequency;
    scale[BEARING] = 1.0;
    scale[CARRIER_VELOCITY] = scale[CARRIER_X_VELOCITY] = depth * p->frequency;
    scale[TEMPERATURE] = 1.0;
    for (int s = CHARGE; s < CHARGE + 4; s++)
        scale[s] = INFINITY; /* an integral that moves nothing */
    for (int s = LOOP; s < NETWORK; s++)
        scale[s] = 1.0;
    for (int s = NETWORK; s < STATES; s++) /* 1 V, and the current at the capacitance that it causes */
        scale[s] = (s - NETWORK) % 8 < 4 ? 2.0 * PI * p->frequency * p->capacitance_a : 1.0;
}

void motor_scales(const struct motor *motor, double scale[STATES])
{
    find_scales(&motor->value, scale);
    for (int s = CHARGE; s < CHARGE + 4; s++)
        scale[s] = 1.0;
}

/* Set the order of elimination: states that do not change, those by which rates change, and the others, which need no column. */
static void find_order(struct solver *solver)
{
    int none[STATES], constant[STATES], place = 0;

    for (int s = 0; s < STATES; s++) {
        none[s] = constant[s] = 1;
        for (int other = 0; other < STATES; other++) {
            none[s] &= solver->jacobian[other][s] == 0.0;
            constant[s] &= solver->jacobian[s][other] == 0.0;
        }
    }
    for (int kind = 0; kind < 3; kind++) {
        for (int s = 0; s < STATES; s++)
            if (kind == (none[s] ? 2 : constant[s] ? 0 : 1))
                solver->order[place++] = s;
        if (kind == 1)
            solver->coupled = place;
    }
}

/* Find the derivatives of the rates by the states. The contacts, which take most of the time, are evaluated once for each
   number in their paths; they change with the states as these do. */
static void find_jacobian(struct motor *m, const double state[STATES])
{
    enum { NUMBERS = sizeof(struct path) / sizeof(double), FOUND = sizeof(struct contact) / sizeof(double) };
    struct solver *solver = &m->solver;
    struct path paths[CONTACTS], others[CONTACTS];
    struct flow here, there;
    double depth = static_penetration(&m->value);
    double slope[CONTACTS][NUMBERS][FOUND], moved[STATES];
    struct guess guess[CONTACTS];

    find_paths(m, state, paths);
    for (int c = 0; c < CONTACTS; c++) {
        touch(m, c, &paths[c]); /* so that the roots of all evaluations begin at those of this one */
        here.contact[c] = touch(m, c, &paths[c]);
    }
    memcpy(guess, m->guess, sizeof guess);
    respond(m, state, &here);
    for (int c = 0; c < CONTACTS; c++)
        for (int n = 0; n < NUMBERS; n++) {
            struct path other = paths[c];
            const double *number = &((double *)&paths[c])[n];
            double change = 1e-6 * (number == &paths[c].speed ? depth * other.frequency / m->value.radius : depth);
            if (number == &paths[c].frequency) {
                change = 1e-6 * other.frequency;
                if (!TRACKED) /* no state changes it */
                    continue;
            }
            ((double *)&other)[n] += change;
            struct contact touched = touch(m, c, &other);
            memcpy(m->guess, guess, sizeof guess);
            for (int k = 0; k < FOUND; k++)
                slope[c][n][k] = (((double *)&touched)[k] - ((double *)&here.contact[c])[k]) / change;
        }
    for (int column = 0; column < STATES; column++) {
        double change = isfinite(solver->scale[column]) ? 1e-6 * solver->scale[column] : 1.0;
        memcpy(moved, state, sizeof moved);
        moved[column] += change;
        find_paths(m, moved, others);
        memcpy(there.contact, here.contact, sizeof there.contact);
        for (int c = 0; c < CONTACTS; c++)
            for (int n = 0; n < NUMBERS; n++) {
                double by = ((double *)&others[c])[n] - ((double *)&paths[c])[n];
                if (by != 0.0)
                    for (int k = 0; k < FOUND; k++)
                        ((double *)&there.contact[c])[k] += by * slope[c][n][k];
            }
        respond(m, moved, &there);
        for (int row = 0; row < STATES; row++)
            solver->jacobian[row][column] = (there.rate[row] - here.rate[row]) / change;
    }
    find_order(solver);
    solver->weight = 0.0;
    solver->old = solver->slow = 0;
    solver->known = 1;
}

/* Decompose 1 - weight * jacobian into triangles, with pivots; the matrix is stored by its columns, its diagonal inverted. */
VECTORS static void decompose(struct solver *solver, double weight)
{
    double (*a)[STATES] = solver->matrix;
    const int *order = solver->order;

    for (int column = 0; column < solver->coupled; column++)
        for (int row = 0; row < STATES; row++)
            a[column][row] = (row == column) - weight * solver->jacobian[order[row]][order[column]];
    for (int k = 0; k < solver->coupled; k++) {
        int best = k;
        for (int row = k + 1; row < solver->coupled; row++)
            if (fabs(a[k][row]) > fabs(a[k][best]))
                best = row;
        solver->pivot[k] = best;
        for (int column = 0; column < solver->coupled; column++) {
            double kept = a[column][k];
            a[column][k] = a[column][best];
            a[column][best] = kept;
        }
        a[k][k] = 1.0 / a[k][k];
        for (int row = k + 1; row < STATES; row++)
            a[k][row] *= a[k][k];
        for (int column = k + 1; column < solver->coupled; column++) {
            double factor = a[column][k];
            if (factor != 0.0)
                for (int row = k + 1; row < STATES; row++)
                    a[column][row] -= factor * a[k][row];
        }
    }
    solver->shrink = solver->weight > 0.0 ? fmin(solver->shrink * weight / solver->weight, SLOW) : SLOW;
    solver->weight = weight;
}

VECTORS static void substitute(const struct solver *solver, double vector[STATES])
{
    double v[STATES];

    for (int k = 0; k < STATES; k++)
        v[k] = vector[solver->order[k]];
    for (int k = 0; k < solver->coupled; k++) {
        double kept = v[solver->pivot[k]];
        v[solver->pivot[k]] = v[k];
        v[k] = kept;
    }
    /* two columns at once halve the passes through memory */
    int odd = solver->coupled % 2, even = solver->coupled - odd;
    for (int k = 0; k < even; k += 2) {
        const double *a = solver->matrix[k], *b = solver->matrix[k + 1];
        double first = v[k], second = v[k + 1] - a[k + 1] * first;
        v[k + 1] = second;
        for (int row = k + 2; row < STATES; row++)
            v[row] -= a[row] * first + b[row] * second;
    }
    if (odd) {
        const double *a = solver->matrix[even];
        for (int row = even + 1; row < STATES; row++)
            v[row] -= a[row] * v[even];
        v[even] *= a[even];
        for (int row = 0; row < even; row++)
            v[row] -= a[row] * v[even];
    }
    for (int k = even - 2; k >= 0; k -= 2) {
        const double *a = solver->matrix[k], *b = solver->matrix[k + 1];
        double second = v[k + 1] * b[k + 1], first = (v[k] - b[k] * second) * a[k];
        v[k + 1] = second;
        v[k] = first;
        for (int row = 0; row < k; row++)
            v[row] -= a[row] * first + b[row] * second;
    }
    for (int k = 0; k < STATES; k++)
        vector[solver->order[k]] = v[k];
}

/* Return the greatest of the changes over the error that a step may have, and infinity for one that is not finite. */
static double measure(const struct solver *solver, const double change[STATES], const double state[STATES])
{
    double largest = 0.0;

    for (int s = 0; s < STATES; s++) {
        double part = fabs(change[s]) / (TOLERANCE * (solver->scale[s] + fabs(state[s])));
        largest = isfinite(change[s]) && isfinite(state[s]) ? fmax(largest, part) : INFINITY;
    }
    return largest;
}

/* Solve state = known + weight * rate(state) from a guess; return whether Newton's method ends. */
static int solved(struct motor *m, const double known[STATES], double weight, double state[STATES], double rate[STATES])
{
    struct solver *solver = &m->solver;
    struct flow flow;
    double change[STATES], before = 0.0, limit = m->taken == 0.0 ? SOLVED * QUIET : SOLVED;

    for (int n = 0; n < ITERATIONS; n++) {
        evaluate(m, state, &flow);
        for (int s = 0; s < STATES; s++)
            change[s] = known[s] + weight * flow.rate[s] - state[s];
        substitute(solver, change);
        double largest = measure(solver, change, state);
        for (int s = 0; s < STATES; s++)
            state[s] += change[s];
        /* the restart of a loop changes the Jacobian matrix at once, so that there the ratio is always measured */
        double shrink = n > 0 && before > 0.0 ? largest / before : TRACKED ? SLOW : fmin(AGES * solver->shrink, SLOW);
        if (!isfinite(largest) || (n > 1 && shrink >= 1.0))
            return 0;
        solver->shrink = fmin(fmax(shrink, FAST), SLOW);
        if (n > 0 && shrink > SLOW)
            solver->slow = solver->old;
        if (largest <= 1e-6 || (shrink < 1.0 && largest * shrink / (1.0 - shrink) <= limit)) {
            for (int s = 0; s < STATES; s++)
                rate[s] = (state[s] - known[s]) / weight;
            return 1;
        }
        before = largest;
    }
    return 0;
}

/* Set the inputs to those at a time after the begin of a step. */
static void move_inputs(struct motor *m, const double from[INPUT_COUNT], double time)
{
    for (int i = 0; i < INPUT_COUNT; i++)
        ((double *)&m->value)[i] = from[i] + m->slope[i] * time;
}

/* What a step finds at its middle and at its end. */
struct found {
    double middle[STATES], between[STATES]; /* states and their rates at the end of the trapezoidal part */
    double state[STATES], rate[STATES];
    int corrected; /* whether the state is that of third order */
};

/* Try one step; return its estimated error over the one that it may have, or infinity if it is not solved. */
static double attempt(struct motor *m, const double inputs[INPUT_COUNT], double step, struct found *f)
{
    struct solver *solver = &m->solver;
    double known[STATES], error[STATES], change[STATES], weight = WEIGHT * step, ahead = MIDDLE * step;
    int quiet = m->taken == 0.0, follows = step <= LONGER * m->taken; /* guesses by the rates in the step before, too */

    if (fabs(solver->weight - weight) > 1e-6 * weight)
        decompose(solver, weight);
    move_inputs(m, inputs, ahead);
    for (int s = 0; s < STATES; s++) {
        known[s] = m->state[s] + weight * m->rate[s];
        double bent = follows ? ahead * (m->bend[s] / 2.0 + ahead * m->twist[s] / 3.0) : 0.0;
        f->middle[s] = m->state[s] + (quiet ? 0.0 : ahead * (m->rate[s] + bent));
    }
    if (!solved(m, known, weight, f->middle, f->between))
        return INFINITY;
    move_inputs(m, inputs, step);
    for (int s = 0; s < STATES; s++) {
        double whole = (f->between[s] - m->rate[s]) / ahead, twist = follows ? (whole - m->bend[s]) / ahead : 0.0;
        known[s] = m->state[s] + SHARE * step * (m->rate[s] + f->between[s]);
        f->state[s] = quiet ? f->middle[s]
            : m->state[s] + step * (m->rate[s] + step * ((whole - twist * ahead) / 2.0 + step * twist / 3.0));
    }
    if (!solved(m, known, weight, f->state, f->rate))
        return INFINITY;
    for (int s = 0; s < STATES; s++) /* from the formula of second order to that of third order with these three rates */
        error[s] = step / 3.0 * ((1.0 - 4.0 * SHARE) * m->rate[s] + f->between[s] - 2.0 * WEIGHT * f->rate[s]);
    substitute(solver, error);
    double second = measure(solver, error, f->state);
    f->corrected = second > QUIET;
    if (!f->corrected)
        return second;
    memcpy(change, error, sizeof change);
    substitute(solver, change);
    for (int s = 0; s < STATES; s++) {
        error[s] -= change[s];
        f->state[s] += change[s];
        f->rate[s] -= error[s] / weight;
    }
    return measure(solver, error, f->state);
}

double motor_shortest_step(const struct motor *motor) { return SHORTEST / motor->value.frequency; }

void motor_begin(struct motor *motor)
{
    struct flow flow;

    evaluate(motor, motor->state, &flow);
    memcpy(motor->rate, flow.rate, sizeof motor->rate);
}

/* Add the voltages of the groups and the power into them over a time, s; the currents are the rates of the charges. */
static void add_integrals(struct motor *m, const double state[STATES], const double rate[STATES], double time)
{
    for (int group = 0; group < 2; group++) {
        const double *current = rate + CHARGE + 2 * group;
        phasor u = voltage(m, state, group);
        m->flux[group] = sum(m->flux[group], scaled(time, u));
        m->energy += 0.5 * time * (u.re * current[0] + u.im * current[1]);
    }
}

double motor_step(struct motor *m, double left)
{
    struct solver *solver = &m->solver;
    double shortest = motor_shortest_step(m), inputs[INPUT_COUNT], factor;
    struct found f;
    double most = fmax(fmin(m->step, m->longest), shortest);
    double step = left / ceil(left / most * (1.0 - 1e-9)); /* equal parts need one matrix */
    int shortened = 0;

    memcpy(inputs, &m->value, sizeof inputs);
    if (!solver->known)
        find_scales(&m->value, solver->scale);
    if (!solver->known || solver->slow)
        find_jacobian(m, m->state);
    for (;;) {
        double error = attempt(m, inputs, step, &f);
        factor = fmin(fmax(0.9 * pow(error, -0.25), 0.2), 4.0);
        if (error <= 1.0 || (isfinite(error) && step <= shortest))
            break;
        move_inputs(m, inputs, 0.0);
        if (!isfinite(error) && solver->old)
            find_jacobian(m, m->state);
        else if (step < ldexp(shortest, -HALVINGS))
            return -1.0;
        else
            shortened = 1, step = isfinite(error) ? fmax(factor * step, fmin(step, shortest)) : 0.25 * step;
    }
    /* the weights of the formula of third order */
    add_integrals(m, f.state, f.rate, WEIGHT / 3.0 * step);
    move_inputs(m, inputs, MIDDLE * step);
    add_integrals(m, f.middle, f.between, (1.0 / 3.0 + SHARE) * step);
    move_inputs(m, inputs, 0.0);
    add_integrals(m, m->state, m->rate, (1.0 - SHARE) / 3.0 * step);
    move_inputs(m, inputs, step);
    for (int s = 0; s < STATES; s++) {
        double behind = (1.0 - MIDDLE) * step, late = (f.rate[s] - f.between[s]) / behind;
        m->twist[s] = (late - (f.rate[s] - m->rate[s]) / step) / (MIDDLE * step);
        m->bend[s] = late + m->twist[s] * behind;
        m->state[s] = f.state[s];
        m->rate[s] = f.rate[s];
    }
    m->taken = f.corrected ? step : 0.0;
    solver->old = 1;
    if (shortened || factor < 1.0 || factor * step > 1.5 * m->step)
        m->step = fmax(factor * step, shortest);
    return step;
}

int motor_advance(struct motor *motor, double duration)
{
    motor_begin(motor);
    for (double left = duration; left > 1e-12 * duration;) {
        double step = motor_step(motor, left);
        if (step < 0.0)
            return -1;
        left -= step;
    }
    motor_measure(motor);
    return 0;
}

void motor_linearise(struct motor *m, double by_input[STATES][INPUT_COUNT])
{
    double *inputs = (double *)&m->value;
    struct flow more, less;

    find_scales(&m->value, m->solver.scale);
    find_jacobian(m, m->state);
    for (int i = 0; i < INPUT_COUNT; i++) {
        double kept = inputs[i], change = 1e-6 * fmax(fabs(kept), 1e-3);
        inputs[i] = kept + change;
        evaluate(m, m->state, &more);
        inputs[i] = kept - change;
        evaluate(m, m->state, &less);
        inputs[i] = kept;
        for (int s = 0; s < STATES; s++)
            by_input[s][i] = (more.rate[s] - less.rate[s]) / (2.0 * change);
    }
}
