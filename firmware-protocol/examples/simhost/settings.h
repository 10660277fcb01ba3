/* The command line of simhost. */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>
#include <stdint.h>

struct settings {
    const char *firmware, *link_name, *mcu;
    const char *motion; /* NULL: no sensor on the bus */
    uint32_t frequency_hz;
    double duration_s;
    double unplugged_from_s, unplugged_to_s;
    bool paced, reset_on_open;
};

/* Reads the command line. Prints what is wrong with it and gives false; `--help` prints the usage and ends the program. */
bool settings_read(int argc, char **argv, struct settings *settings);

#endif
