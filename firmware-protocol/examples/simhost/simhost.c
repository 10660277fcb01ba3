/* Runs an AVR firmware under simavr at the pace of the clock, with its UART 0 on a pseudo terminal: to a program it looks
 * like a serial device. `simhost --help` has the usage. */
#define _GNU_SOURCE
#include <elf.h>
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

#include "mpu6050.h"
#include "settings.h"
#include "terminal.h"

/* The terminal is served every millisecond of AVR time. */
#define SLICES_PER_SECOND 1000
/* Bytes from the terminal that wait for the UART. */
#define INBOX_SIZE 64

/* Exit status. */
enum { DONE = 0, FAILED = 1, USAGE = 2 };

struct host {
    avr_t *avr;
    struct terminal terminal;
    struct avr_irq_t *to_uart;
    bool uart_full;
    unsigned char inbox[INBOX_SIZE];
    size_t inbox_length, inbox_at;
    bool has_sensor;
    struct mpu6050 sensor;
    double started_s;   /* on this computer's clock */
    double worst_lag_s; /* behind it */
};

static volatile sig_atomic_t stop;

static void on_signal(int signal_number)
{
    (void)signal_number;
    stop = 1;
}

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

/* ---------------------------------------------------------------- the simulated microcontroller */

/* simavr talks much; what is no error is left out. */
static void log_errors(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level == LOG_ERROR) {
        fputs("simavr: ", stderr);
        vfprintf(stderr, format, arguments);
    }
}

/* simavr would sleep by its own clock when the CPU sleeps; the pace is kept in `keep_pace`. */
static void do_not_sleep(avr_t *avr, avr_cycle_count_t how_long)
{
    (void)avr;
    (void)how_long;
}

/* Says on stderr if it is not. simavr itself takes a text for an empty program and falls over other machines' programs. */
static bool is_avr_program(const char *path)
{
    static const unsigned char magic[] = {0x7F, 'E', 'L', 'F', 1 /* 32 bit */, 1 /* little-endian */};
    unsigned char head[20] = {0};
    FILE *file = fopen(path, "rb");
    if (!file) {
        fprintf(stderr, "simhost: cannot open %s: %s\n", path, strerror(errno));
        return false;
    }
    size_t length = fread(head, 1, sizeof head, file);
    fclose(file);
    bool found = length == sizeof head && memcmp(head, magic, sizeof magic) == 0 && head[18] == EM_AVR && head[19] == 0;
    if (!found)
        fprintf(stderr, "simhost: %s is no AVR program in ELF\n", path);
    return found;
}

/* NULL if it cannot be done, said on stderr. */
static avr_t *load(const struct settings *settings)
{
    static elf_firmware_t firmware;
    avr_global_logger_set(log_errors);
    if (!is_avr_program(settings->firmware))
        return NULL;
    if (elf_read_firmware(settings->firmware, &firmware)) {
        fprintf(stderr, "simhost: simavr cannot load %s\n", settings->firmware);
        return NULL;
    }
    avr_t *avr = avr_make_mcu_by_name(settings->mcu);
    if (!avr) {
        fprintf(stderr, "simhost: simavr does not know the microcontroller '%s'\n", settings->mcu);
        return NULL;
    }
    avr_init(avr);
    firmware.frequency = settings->frequency_hz;
    avr_load_firmware(avr, &firmware);
    avr->frequency = settings->frequency_hz;
    avr->sleep = do_not_sleep;
    return avr;
}

static void on_byte_sent(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    terminal_put(&((struct host *)param)->terminal, (unsigned char)value);
}

static void on_uart_ready(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    ((struct host *)param)->uart_full = false;
}

static void on_uart_full(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    ((struct host *)param)->uart_full = true;
}

static void connect_uart(struct host *host)
{
    avr_t *avr = host->avr;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP); /* no echo, no sleep of simavr's own */
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    const uint32_t uart = AVR_IOCTL_UART_GETIRQ('0');
    avr_irq_register_notify(avr_io_getirq(avr, uart, UART_IRQ_OUTPUT), on_byte_sent, host);
    avr_irq_register_notify(avr_io_getirq(avr, uart, UART_IRQ_OUT_XON), on_uart_ready, host);
    avr_irq_register_notify(avr_io_getirq(avr, uart, UART_IRQ_OUT_XOFF), on_uart_full, host);
    host->to_uart = avr_io_getirq(avr, uart, UART_IRQ_INPUT);
}

/* Power off and on again: the sensor forgets, too. */
static void restart(struct host *host)
{
    avr_reset(host->avr);
    host->inbox_length = host->inbox_at = 0;
    host->uart_full = false;
    if (host->has_sensor)
        mpu6050_power_up(&host->sensor);
}

/* ---------------------------------------------------------------- the run */

/* Runs the CPU up to a cycle; false when it has stopped for good. */
static bool run_until(avr_t *avr, uint64_t cycle)
{
    while (avr->cycle < cycle) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "simhost: the CPU %s at cycle %llu, address 0x%x\n",
                    state == cpu_Done ? "went to sleep with interrupts off" : "crashed",
                    (unsigned long long)avr->cycle, (unsigned)avr->pc);
            return false;
        }
    }
    return true;
}

/* Hands bytes of the terminal to the UART as it takes them; the rest waits in the terminal. */
static void feed_uart(struct host *host)
{
    if (host->inbox_at == host->inbox_length) {
        host->inbox_length = terminal_read(&host->terminal, host->inbox, INBOX_SIZE);
        host->inbox_at = 0;
    }
    while (host->inbox_at < host->inbox_length && !host->uart_full)
        avr_raise_irq(host->to_uart, host->inbox[host->inbox_at++]);
}

static void sleep_for(double seconds)
{
    struct timespec pause = {(time_t)seconds, (long)(fmod(seconds, 1.0) * 1e9)};
    nanosleep(&pause, NULL);
}

/* How far AVR time is ahead of the clock. */
static double ahead_s(const struct host *host)
{
    return (double)host->avr->cycle / host->avr->frequency - (now_s() - host->started_s);
}

/* Hands the slice's bytes over. A reader that is too slow loses some, as on a real line, unless they come in a burst
 * because this process was kept from running: then they wait for as long as AVR time is behind. */
static void hand_over(struct host *host)
{
    while (!terminal_flush(&host->terminal) && !stop && ahead_s(host) < 0)
        sleep_for(0.001);
    terminal_drop(&host->terminal);
}

/* Sleeps while AVR time is ahead of the clock, and notes how far it ever was behind. */
static void keep_pace(struct host *host)
{
    double ahead = ahead_s(host);
    if (ahead > 0)
        sleep_for(ahead);
    else
        host->worst_lag_s = fmax(host->worst_lag_s, -ahead);
}

static int run(struct host *host, const struct settings *settings)
{
    const uint64_t slice = settings->frequency_hz / SLICES_PER_SECOND;
    uint64_t until = 0;
    double avr_s = 0;
    host->started_s = now_s();
    while (!stop && avr_s < settings->duration_s) {
        if (terminal_was_opened(&host->terminal) && settings->reset_on_open)
            restart(host);
        feed_uart(host);
        until += slice;
        if (!run_until(host->avr, until))
            return FAILED;
        hand_over(host);
        avr_s = (double)host->avr->cycle / settings->frequency_hz;
        if (settings->paced)
            keep_pace(host);
    }
    fprintf(stderr,
            "simhost: %.3f s of AVR time in %.3f s, at most %.1f ms behind; "
            "%lu bytes sent, %lu dropped, %lu unheard\n",
            avr_s, now_s() - host->started_s, host->worst_lag_s * 1e3, host->terminal.sent_bytes,
            host->terminal.dropped_bytes, host->terminal.unheard_bytes);
    return DONE;
}

static void stop_on_signals(void)
{
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

int main(int argc, char **argv)
{
    static struct host host;
    struct settings settings;
    struct motion motion = {0};
    if (!settings_read(argc, argv, &settings))
        return USAGE;
    if (settings.motion && !motion_read(&motion, settings.motion))
        return FAILED;
    host.avr = load(&settings);
    if (!host.avr || !terminal_open(&host.terminal, settings.link_name))
        return FAILED;
    stop_on_signals();
    connect_uart(&host);
    host.has_sensor = settings.motion != NULL;
    if (host.has_sensor) {
        mpu6050_connect(&host.sensor, host.avr, &motion);
        host.sensor.unplugged_from_s = settings.unplugged_from_s;
        host.sensor.unplugged_to_s = settings.unplugged_to_s;
    }
    int status = run(&host, &settings);
    terminal_close(&host.terminal);
    motion_free(&motion);
    return status;
}
