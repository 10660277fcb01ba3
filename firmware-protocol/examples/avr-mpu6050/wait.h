/* How interrupts hand work to the main loop, which sleeps until there is some. */
#ifndef WAIT_H
#define WAIT_H

#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <stdbool.h>

/* Set by an interrupt that leaves something for the main loop. */
extern volatile bool work_waiting;

/* Sleeps until an interrupt has left work. The check and the sleep cannot be separated by an interrupt: sei takes effect
 * one instruction later, with the CPU asleep. */
static inline void wait_for_work(void)
{
    cli();
    while (!work_waiting) {
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
        cli();
    }
    work_waiting = false;
    sei();
}

#endif
