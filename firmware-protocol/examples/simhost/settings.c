#define _GNU_SOURCE
#include "settings.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char usage[] =
    "usage: simhost [OPTION...] FIRMWARE.elf LINK\n"
    "Runs FIRMWARE.elf with its UART 0 on a pseudo terminal named by the symbolic link LINK, until SIGINT or SIGTERM.\n"
    "\n"
    "  --mcu NAME            default atmega328p\n"
    "  --frequency-hz N      default 16000000\n"
    "  --duration-s S        stop after S seconds of AVR time\n"
    "  --no-pace             as fast as it goes, instead of at the pace of the clock\n"
    "  --reset-on-open       restart the firmware when the terminal is opened, as the DTR line of an Arduino does\n"
    "  --mpu6050 FILE        put an MPU-6050 on the I2C bus that goes through the motion in FILE: lines of\n"
    "                        t_s wx wy wz fx fy fz, in s, deg/s and g, straight lines in between\n"
    "  --unplug FROM,TO      the MPU-6050 is gone between these seconds after the start of the firmware\n"
    "\n"
    "At the end it says how long it ran, how far it fell behind, and what became of the firmware's bytes.\n"
    "Exit status: 0 done, 1 failed, 2 usage.\n";

static bool read_number(const char *option, const char *text, double least, double most, double *number)
{
    char *end;
    *number = strtod(text, &end);
    if (end != text && *end == '\0' && *number >= least && *number <= most)
        return true;
    fprintf(stderr, "simhost: --%s: expected a number from %g to %g, got '%s'\n", option, least, most, text);
    return false;
}

static bool read_window(const char *text, double *from_s, double *to_s)
{
    char rest;
    if (sscanf(text, "%lf,%lf%c", from_s, to_s, &rest) == 2 && *from_s >= 0 && *from_s < *to_s)
        return true;
    fprintf(stderr, "simhost: --unplug: expected FROM,TO in seconds, FROM first, got '%s'\n", text);
    return false;
}

static bool read_option(const char *name, const char *value, struct settings *settings)
{
    double number;
    if (strcmp(name, "mcu") == 0)
        settings->mcu = value;
    else if (strcmp(name, "mpu6050") == 0)
        settings->motion = value;
    else if (strcmp(name, "no-pace") == 0)
        settings->paced = false;
    else if (strcmp(name, "reset-on-open") == 0)
        settings->reset_on_open = true;
    else if (strcmp(name, "unplug") == 0)
        return read_window(value, &settings->unplugged_from_s, &settings->unplugged_to_s);
    else if (strcmp(name, "duration-s") == 0)
        return read_number(name, value, 0, 1e9, &settings->duration_s);
    else if (strcmp(name, "frequency-hz") == 0) {
        if (!read_number(name, value, 1e5, 1e8, &number))
            return false;
        settings->frequency_hz = (uint32_t)number;
    }
    return true;
}

bool settings_read(int argc, char **argv, struct settings *settings)
{
    static const struct option options[] = {
        {"mcu", required_argument, NULL, 0},          {"frequency-hz", required_argument, NULL, 0},
        {"duration-s", required_argument, NULL, 0},   {"no-pace", no_argument, NULL, 0},
        {"reset-on-open", no_argument, NULL, 0},      {"mpu6050", required_argument, NULL, 0},
        {"unplug", required_argument, NULL, 0},       {"help", no_argument, NULL, 'h'},
        {NULL, 0, NULL, 0},
    };
    *settings = (struct settings){.mcu = "atmega328p", .frequency_hz = 16000000, .duration_s = INFINITY, .paced = true};
    int found, index = 0;
    while ((found = getopt_long(argc, argv, "h", options, &index)) != -1) {
        if (found == 'h') {
            fputs(usage, stdout);
            exit(EXIT_SUCCESS);
        }
        if (found == '?' || !read_option(options[index].name, optarg, settings))
            return false;
    }
    if (argc - optind != 2) {
        fputs(usage, stderr);
        return false;
    }
    settings->firmware = argv[optind];
    settings->link_name = argv[optind + 1];
    return true;
}
