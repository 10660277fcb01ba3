/* The motion a simulated sensor goes through: moments from a file, straight lines in between. */
#ifndef MOTION_H
#define MOTION_H

#include <stdbool.h>
#include <stddef.h>

/* In the sensor's frame. */
struct motion_state {
    double omega_dps[3];        /* angular rate, deg/s */
    double specific_force_g[3]; /* a - g, in standard gravities */
};

struct motion_point {
    double t_s;
    struct motion_state state;
};

struct motion {
    struct motion_point *points;
    size_t count;
};

/* Reads lines of `t_s wx wy wz fx fy fz` [s, deg/s, g] with rising times; # starts a comment. Prints what is wrong and
 * where, and gives false. */
bool motion_read(struct motion *motion, const char *path);

/* The state at t_s: between two points linear, before the first and after the last as they are. */
struct motion_state motion_at(const struct motion *motion, double t_s);

void motion_free(struct motion *motion);

#endif
