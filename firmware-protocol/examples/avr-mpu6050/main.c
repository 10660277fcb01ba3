/* An IMU that speaks otolith's protocol: sleeps, and does what interrupts have left to do. README.md has wiring and
 * limits. */
#include <avr/interrupt.h>
#include <avr/sleep.h>

#include "device.h"
#include "wait.h"

/* Beats of 25 ms. */
#define STATUS_BEATS 4
#define HELLO_BEATS 40

volatile bool work_waiting;

/* STATUS ten times, HELLO once a second. */
static void on_beat(void)
{
    static uint8_t beats;
    beats = (beats + 1) % HELLO_BEATS;
    if (beats == 0)
        device_send_hello();
    if (beats % STATUS_BEATS == 0)
        device_send_status();
}

/* Asks the sensor at its tick, sends what it answers. */
static void measure(void)
{
    static struct instant asked_at;
    struct reading reading;
    struct instant due;
    if (sensor_poll(&reading) && device_measures())
        device_send_sample(asked_at, &reading);
    if (clock_take_tick(&due) && device_measures()) {
        asked_at = due;
        sensor_begin(due);
        work_waiting = true; /* some sensors answer at once */
    }
    const char *complaint = sensor_take_complaint();
    if (complaint)
        device_send_text(complaint);
}

int main(void)
{
    set_sleep_mode(SLEEP_MODE_IDLE);
    uart_start();
    clock_start(device_first_period());
    sei();
    device_send_hello();
    for (;;) {
        wait_for_work();
        struct uart_frame *request = uart_received();
        if (request) {
            device_answer(request);
            uart_frame_done(request);
            work_waiting = true; /* a second one may wait */
        }
        measure();
        while (clock_take_beat())
            on_beat();
    }
}
