#define _GNU_SOURCE
#include "motion.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool append(struct motion *motion, struct motion_point point)
{
    struct motion_point *more = realloc(motion->points, (motion->count + 1) * sizeof *more);
    if (!more)
        return false;
    more[motion->count++] = point;
    motion->points = more;
    return true;
}

/* NULL, or what is wrong with the line. */
static const char *read_line(struct motion *motion, const char *line)
{
    struct motion_point point;
    double *omega = point.state.omega_dps, *force = point.state.specific_force_g;
    char rest;
    if (line[strspn(line, " \t\r\n")] == '\0')
        return NULL;
    int count = sscanf(line, "%lf %lf %lf %lf %lf %lf %lf %c", &point.t_s, &omega[0], &omega[1], &omega[2], &force[0],
                       &force[1], &force[2], &rest);
    if (count != 7)
        return "expected seven numbers: t_s wx wy wz fx fy fz";
    if (motion->count > 0 && !(point.t_s > motion->points[motion->count - 1].t_s))
        return "the time does not rise";
    return append(motion, point) ? NULL : "out of memory";
}

bool motion_read(struct motion *motion, const char *path)
{
    *motion = (struct motion){0};
    FILE *file = fopen(path, "r");
    if (!file) {
        fprintf(stderr, "simhost: cannot open %s: %s\n", path, strerror(errno));
        return false;
    }
    char line[256];
    const char *wrong = NULL;
    unsigned number = 0;
    while (!wrong && fgets(line, sizeof line, file)) {
        number++;
        line[strcspn(line, "#")] = '\0';
        wrong = read_line(motion, line);
    }
    fclose(file);
    if (!wrong && motion->count == 0)
        wrong = "no motion in it";
    if (wrong)
        fprintf(stderr, "simhost: %s:%u: %s\n", path, number, wrong);
    return !wrong;
}

static double between(double from, double to, double share)
{
    return from + (to - from) * share;
}

struct motion_state motion_at(const struct motion *motion, double t_s)
{
    size_t next = 0;
    while (next < motion->count && motion->points[next].t_s <= t_s)
        next++;
    if (next == 0)
        return motion->points[0].state;
    const struct motion_point *from = &motion->points[next - 1];
    if (next == motion->count)
        return from->state;
    const struct motion_point *to = &motion->points[next];
    double share = (t_s - from->t_s) / (to->t_s - from->t_s);
    struct motion_state state;
    for (int axis = 0; axis < 3; axis++) {
        state.omega_dps[axis] = between(from->state.omega_dps[axis], to->state.omega_dps[axis], share);
        state.specific_force_g[axis]
            = between(from->state.specific_force_g[axis], to->state.specific_force_g[axis], share);
    }
    return state;
}

void motion_free(struct motion *motion)
{
    free(motion->points);
}
