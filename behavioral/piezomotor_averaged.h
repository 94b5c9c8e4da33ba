/* SPDX-License-Identifier: MIT
 *
 * The averaged motor in C: the equations of netlists/piezomotor_averaged.lib, in SI units; docs/tracking.md derives them.
 *
 *   struct motor motor;
 *   motor_default(&motor);                       parameters and inputs of the motor for which the file was exported
 *   motor.value.amplitude_a = 110.0;
 *   motor_rest(&motor);                          preloaded rest
 *   if (motor_advance(&motor, 1e-3) != 0) ...    1 ms of the motor's time; then read motor.value.speed
 *
 * A motor is one struct motor without pointers: a copy of it is a complete copy of its state. There are no other
 * variables, so that several threads may each run a motor.
 *
 * piezomotor_start.h is written by the export: MODES, MOUNTED, MOUNTED_X, START and NAME, and CONTACTS and EXPONENT of a motor
 * that has others than those below. With TRACKED a phase-locked loop sets the frequency; with DRIVEN a network is between the
 * inputs' amplitudes and each group. The package uses both in its own process only.
 *
 * SOURCE generalised averaging of the motor of Andersen, Helbo, Blanke, 2002; docs/tracking.md
 * OMITS  motion of the contact between two phases, partial slip before gross slip, roughness, wear, adhesion; the current
 *        C dU/dt of a changing amplitude, because inputs are constant between two calls
 */
#ifndef PIEZOMOTOR_AVERAGED_H
#define PIEZOMOTOR_AVERAGED_H

#include <stddef.h>

#include "piezomotor_start.h"
#if defined DRIVEN && DRIVEN
#include "piezomotor_network.h" /* likewise, from driver_averaged.lib */
#endif
#if defined TRACKED && TRACKED
#include "piezomotor_tracker.h" /* written by the package from tracker_averaged, _restart and _filter.lib */
#endif

#ifndef TRACKED
#define TRACKED 0
#endif
#ifndef DRIVEN
#define DRIVEN 0
#endif
#ifndef PHASES
#define PHASES 64   /* of a period, at which the contact is evaluated */
#define HARMONICS 3 /* that move the tip */
#endif
#ifndef CONTACTS
#define CONTACTS 1   /* places at which the stator touches the rotor, of one carrier */
#endif
#ifndef EXPONENT
#define EXPONENT 1.5 /* of the normal force in the penetration: that of Hertz */
#endif
enum { ORDERS = HARMONICS + 3 }; /* of the contact's force: the mean, these harmonics, and two more that are checked */

/* Every line: name, unit, minimum, maximum, meaning. The export reads these lines too. */
#define INPUTS(ENTRY) \
    ENTRY(amplitude_a, "V", -1e4, 1e4, "amplitude of the voltage of group A") \
    ENTRY(amplitude_b, "V", -1e4, 1e4, "amplitude of the voltage of group B") \
    ENTRY(phase, "deg", -1e6, 1e6, "phase of the voltage of group B ahead of group A") \
    ENTRY(frequency, "Hz", 1, 1e8, "drive frequency") \
    ENTRY(load_torque, "N.m", -1e3, 1e3, "torque that the load draws from the shaft") \
    ENTRY(ambient_temperature, "K", -200, 500, "temperature of the surroundings above that at which the parameters hold")

/* of the motor, which may change while it runs, as the inputs do */
#define TUNABLE(ENTRY) \
    ENTRY(preload, "N", 1e-6, 1e5, "static normal force F_0") \
    ENTRY(friction, "1", 1e-4, 5, "coefficient of friction")

#define OUTPUTS(ENTRY) \
    ENTRY(speed, "rad/s", "rotor speed") \
    ENTRY(position, "rad", "angle of the rotor") \
    ENTRY(load_speed, "rad/s", "speed of the coupled load") \
    ENTRY(load_position, "rad", "angle of the coupled load") \
    ENTRY(current_amplitude_a, "A", "amplitude of the current into group A") \
    ENTRY(current_phase_a, "deg", "phase of the current into group A ahead of the voltage of group A") \
    ENTRY(current_amplitude_b, "A", "amplitude of the current into group B") \
    ENTRY(current_phase_b, "deg", "phase of the current into group B ahead of the voltage of group B") \
    ENTRY(temperature, "K", "temperature of the stator above that at which the parameters hold") \
    ENTRY(check, "1", "motion at the harmonics left out, relative to penetration and limit of stick; accurate below 0.02") \
    ENTRY(separated, "1", "share of the period in which the contact is open") \
    ENTRY(slip, "1", "share of the period in which the contact slips") \
    ENTRY(torque, "N.m", "mean torque of the contact on the rotor") \
    ENTRY(normal_force, "N", "mean normal force") \
    ENTRY(electrical_power, "W", "real power into both groups") \
    ENTRY(heat, "W", "losses of the stator: dielectric and modal damping") \
    ENTRY(contact_power, "W", "power of the stator into the contact: friction loss and power on the rotor") \
    ENTRY(stored_energy, "J", "energy in the modes and the clamped capacitances, mean over a period") \
    ENTRY(tip_x_amplitude, "m", "amplitude of the tip's fundamental, tangential") \
    ENTRY(tip_y_amplitude, "m", "amplitude of the tip's fundamental, towards the rotor")

/* of a phase-locked loop, which sets the frequency */
#if TRACKED
#define LOOP_INPUTS(ENTRY) \
    ENTRY(target, "deg", -360, 360, "phase wanted of the motional current, ahead of the force")
#define LOOP_OUTPUTS(ENTRY) \
    ENTRY(control, "V", "control voltage of the oscillator") \
    ENTRY(restart, "1", "1 while a restart returns the oscillator to its start, else 0") \
    ENTRY(mode_phase, "deg", "phase of the velocity of the mode that is followed, ahead of the force of the groups")
#else
#define LOOP_INPUTS(ENTRY)
#define LOOP_OUTPUTS(ENTRY)
#endif

/* of a network between the stages, whose amplitudes are the inputs, and the groups */
#if DRIVEN
#define NETWORK_OUTPUTS(ENTRY) \
    ENTRY(pin_amplitude_a, "V", "amplitude of the voltage of group A") \
    ENTRY(pin_amplitude_b, "V", "amplitude of the voltage of group B") \
    ENTRY(pin_phase_a, "deg", "phase of the voltage of group A ahead of the stage of group A") \
    ENTRY(pin_phase_b, "deg", "phase of the voltage of group B ahead of the stage of group B")
#else
#define NETWORK_OUTPUTS(ENTRY)
#endif

/* of each contact */
#define CONTACT_PARAMETERS(ENTRY) \
    ENTRY(sliding_ratio, "1", 0.01, 1, "friction of fast sliding over the coefficient of friction") \
    ENTRY(stribeck_velocity, "m/s", 1e-6, 1e3, "slip velocity over which the friction falls") \
    ENTRY(normal_stiffness, "N/m^1.5", 1e3, 1e13, "K_N of the Hertz law") \
    ENTRY(compliance, "m/N^(2/3)", 2.2e-10, 1e-2, "tangential compliance K_t of tip and rotor together") \
    ENTRY(normal_damping, "s/m", 0, 1e6, "Hunt-Crossley damping: the normal force grows by this times the approach velocity") \
    ENTRY(series_compliance, "m/N", 0, 1e-3, "compliance along the normal, in series with the contact") \
    ENTRY(series_compliance_x, "m/N", 0, 1e-3, "compliance along the rotor, in series with the contact") \
    ENTRY(radius, "m", 1e-4, 10, "radius of the rotor")

#define PARAMETERS(ENTRY) \
    ENTRY(inertia, "kg.m2", 1e-13, 1e3, "moment of inertia") \
    ENTRY(bearing, "N.m.s", 0, 1e3, "viscous bearing coefficient") \
    ENTRY(bearing_friction, "N.m", 0, 1e3, "torque of dry friction of the bearing") \
    ENTRY(bearing_presliding, "rad", 1e-9, 1, "angle over which it comes to 63 % of its value") \
    ENTRY(load_inertia, "kg.m2", 0, 1e3, "moment of inertia that is coupled to the shaft; 0: none, and no coupling") \
    ENTRY(load_damping, "N.m.s", 0, 1e3, "viscous friction of the load") \
    ENTRY(load_spring, "N.m/rad", 0, 1e6, "spring that pulls the load to the angle 0") \
    ENTRY(load_gravity, "N.m", 0, 1e3, "maximum torque of the load's weight") \
    ENTRY(load_angle, "deg", -360, 360, "angle of the load's centre of mass from its lowest place, at the position 0") \
    ENTRY(coupling_stiffness, "N.m/rad", 0, 1e6, "stiffness of the shaft to the load; 0: rigid") \
    ENTRY(coupling_damping, "N.m.s", 0, 1e3, "damping of the shaft to the load") \
    ENTRY(backlash, "rad", 0, 1, "play of the coupling from end to end") \
    ENTRY(capacitance_a, "F", 1e-15, 1e-3, "clamped capacitance of group A at 100 kHz") \
    ENTRY(capacitance_b, "F", 1e-15, 1e-3, "clamped capacitance of group B at 100 kHz") \
    ENTRY(capacitance_ab, "F", -1e-3, 1e-3, "capacitance between the groups at 100 kHz, a part of both others") \
    ENTRY(motion_x_a, "m/V", -1e-6, 1e-6, "motion of the tip along the rotor per volt on group A, by modes left out") \
    ENTRY(motion_x_b, "m/V", -1e-6, 1e-6, "motion of the tip along the rotor per volt on group B, by modes left out") \
    ENTRY(motion_y_a, "m/V", -1e-6, 1e-6, "motion of the tip towards the rotor per volt on group A, by modes left out") \
    ENTRY(motion_y_b, "m/V", -1e-6, 1e-6, "motion of the tip towards the rotor per volt on group B, by modes left out") \
    ENTRY(loss, "1", 0, 0.5, "dielectric loss tangent") \
    ENTRY(frequency_drift, "1/K", -0.01, 0.01, "relative drift of the resonance frequencies") \
    ENTRY(coupling_drift, "1/K", -0.01, 0.01, "relative drift of the couplings") \
    ENTRY(capacitance_drift, "1/K", -0.02, 0.02, "relative drift of the clamped capacitances") \
    ENTRY(heat_capacity, "J/K", 0, 1e6, "heat capacity of the stator; 0: its temperature is that of the surroundings") \
    ENTRY(thermal_resistance, "K/W", 1e-3, 1e6, "thermal resistance to the surroundings")

/* of the stator's carrier on plate springs; without effect where MOUNTED is 0 */
#define MOUNT_PARAMETERS(ENTRY) \
    ENTRY(mount_stiffness, "N/m", 1, 1e13, "stiffness of the mount") \
    ENTRY(mount_mass, "kg", 1e-9, 1e3, "mass of the carrier") \
    ENTRY(mount_damping, "N.s/m", 1e-9, 1e9, "damping of the mount")

/* of the carrier along the rotor; without effect where MOUNTED_X is 0 */
#define MOUNT_X_PARAMETERS(ENTRY) \
    ENTRY(mount_x_stiffness, "N/m", 1, 1e13, "stiffness of the mount along the rotor") \
    ENTRY(mount_x_mass, "kg", 1e-9, 1e3, "mass of the carrier along the rotor") \
    ENTRY(mount_x_damping, "N.s/m", 1e-9, 1e9, "damping of the mount along the rotor")

/* of each mode */
#define MODE_PARAMETERS(ENTRY) \
    ENTRY(mass, "kg", 1e-12, 1e3, "modal mass") \
    ENTRY(damping, "N.s/m", 1e-12, 1e9, "modal damping") \
    ENTRY(stiffness, "N/m", 1e-3, 1e15, "modal stiffness") \
    ENTRY(coupling_a, "N/V", -1e4, 1e4, "force per volt of group A") \
    ENTRY(coupling_b, "N/V", -1e4, 1e4, "force per volt of group B") \
    ENTRY(tip_x, "1", -1e4, 1e4, "tangential tip displacement per modal coordinate") \
    ENTRY(tip_y, "1", -1e4, 1e4, "tip displacement towards the rotor per modal coordinate")

/* of each of several contacts; one contact has the whole preload */
#define SEAT_PARAMETERS(ENTRY) \
    ENTRY(share, "1", 0, 1, "share of the preload at rest, 0 if it does not touch then") \
    ENTRY(height, "m", -1e-3, 1e-3, "height above the place at which it has that share") \
    ENTRY(friction_ratio, "1", 1e-4, 1e4, "coefficient of friction over that of the motor") \
    ENTRY(direction, "1", -1, 1, "motion along the rotor per motion of the carrier")

/* of each contact behind the first, by each mode */
#define TIP_PARAMETERS(ENTRY) \
    ENTRY(tip_x, "1", -1e4, 1e4, "tangential displacement of this contact per modal coordinate") \
    ENTRY(tip_y, "1", -1e4, 1e4, "displacement of this contact towards the rotor per modal coordinate")

#define FIELD(name, ...) double name;
struct touching { CONTACT_PARAMETERS(FIELD) };
struct seat { SEAT_PARAMETERS(FIELD) };
struct tip { TIP_PARAMETERS(FIELD) };
struct values {
    INPUTS(FIELD)
    TUNABLE(FIELD)
    LOOP_INPUTS(FIELD)
    OUTPUTS(FIELD)
    LOOP_OUTPUTS(FIELD)
    NETWORK_OUTPUTS(FIELD)
    union {
        struct { CONTACT_PARAMETERS(FIELD) }; /* those of the first contact */
        struct touching contact[CONTACTS];
    };
    PARAMETERS(FIELD)
    MOUNT_PARAMETERS(FIELD)
    MOUNT_X_PARAMETERS(FIELD)
    struct mode { MODE_PARAMETERS(FIELD) } mode[MODES];
#if CONTACTS > 1
    struct seat seat[CONTACTS];
    struct tip tip[CONTACTS - 1][MODES]; /* the first contact has those of the modes */
#endif
};
#undef FIELD

typedef struct { double re, im; } phasor;

#define MOVING (MODES + MOUNTED + MOUNTED_X) /* at the harmonics the carrier is one or two further modes, the last */

/* the states; those of a mode are its static deflection (m) and the amplitudes (m) of its harmonics, real and imaginary */
enum {
    SPEED, POSITION, TEMPERATURE,
    LOAD_SPEED, LOAD_POSITION,  /* of the coupled load; those of the rotor if it is rigid */
    BEARING,                    /* share of the dry friction that the bearing takes, -1 to 1 */
    SLIDER,                     /* displacement of the slider of each contact at the end of the period, m */
    CARRIER = SLIDER + CONTACTS, CARRIER_VELOCITY, /* m, m/s, towards the rotor */
    CARRIER_X, CARRIER_X_VELOCITY, /* the same along the rotor */
    CHARGE,                     /* integrals of the amplitudes of the currents into the groups, A.s: real and imaginary parts */
    DEFLECTION = CHARGE + 4,
    AMPLITUDE = DEFLECTION + MODES,
    LOOP = AMPLITUDE + 2 * MOVING * HARMONICS, /* voltages of the loop filter, V: at the oscillator, across its capacitance;
                                                  of a restart: timer, and 1 while it pulls */
    NETWORK = LOOP + 4 * TRACKED, /* of group A, then of B, real and imaginary parts: currents in series and parallel, A;
                                     voltages of the capacitance in series and of the group, V */
    STATES = NETWORK + 16 * DRIVEN
};

#define PLACE(name, ...) name##_place,
enum { INPUTS(PLACE) TUNABLE(PLACE) LOOP_INPUTS(PLACE) INPUT_COUNT }; /* what may change is the first values */
#undef PLACE

/* What the implicit integration keeps from step to step. */
struct solver {
    double scale[STATES];            /* of the states */
    double jacobian[STATES][STATES]; /* derivatives of the rates */
    double matrix[STATES][STATES];   /* 1 - weight * jacobian, decomposed */
    int pivot[STATES];
    int order[STATES], coupled;      /* of elimination; the number of states by which rates change, which are the first */
    double weight;                   /* s; 0 if the matrix is not that of the Jacobian */
    double shrink;                   /* change of Newton's method over the one before it, with this matrix */
    int known, old, slow;            /* Jacobian: there is one; of an earlier state; Newton's method takes long with it */
};

/* The forces at each phase in the last evaluation, N: where the next search of them begins. */
struct guess { double normal[PHASES], friction[PHASES]; };

struct motor {
    struct values value;
    double slope[INPUT_COUNT];    /* rates of the inputs, 1/s: an input changes by them while the motor advances */
    double longest;               /* longest internal step, s */
    double laid;                  /* preload at rest, N: under it a sprung stator was laid against the rotor */
    double state[STATES];
    double rate[STATES];          /* of the states, 1/s */
    double bend[STATES], twist[STATES]; /* rates after the last internal step: rate + (bend + twist * time) * time */
    phasor flux[2];               /* integrals of the amplitudes of the voltages of the groups, V.s */
    double energy;                /* electrical energy into both groups, J */
    double taken, step;           /* last internal step, s; next one, unless the time that is left is shorter */
    struct solver solver;
    struct guess guess[CONTACTS];
    phasor wheel[PHASES][ORDERS]; /* exp(2 pi j h n / PHASES) */
#if TRACKED
    struct tracker tracker;       /* its parameters */
    int followed;                 /* number of the mode, from 0, whose phase is an output */
#endif
#if DRIVEN
    struct network network[2];    /* parameters of the networks of both groups */
#endif
};

void motor_default(struct motor *motor);
void motor_rest(struct motor *motor);
void motor_measure(struct motor *motor);                     /* fills the outputs in motor->value */
int motor_advance(struct motor *motor, double duration);     /* 0, or -1 if the equations of a step have no solution */

/* derivatives of the rates by the inputs; those by the states are in motor->solver.jacobian */
void motor_linearise(struct motor *motor, double by_input[STATES][INPUT_COUNT]);

/* Find sizes of the states that matter: what moves the tip by the static penetration in a period; finite. */
void motor_scales(const struct motor *motor, double scale[STATES]);

/* the parts of motor_advance: one begin, then steps until no time is left, then a measurement */
void motor_begin(struct motor *motor);                       /* after inputs or states changed: finds the rates */
double motor_step(struct motor *motor, double left);         /* one internal step; its length in s, or -1 */
double motor_shortest_step(const struct motor *motor);       /* s */

#endif
