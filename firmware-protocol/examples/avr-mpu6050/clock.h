/* One clock for everything: Timer 1 counts half microseconds, its overflows are counted in software. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdbool.h>
#include <stdint.h>

#define CLOCK_TICKS_PER_SECOND (F_CPU / 8)

#if F_CPU != 16000000
#error "the clock is written for 16 MHz: Timer 1 divided by 8 must count half microseconds"
#endif

/* A moment: cheap to take in an interrupt, made into microseconds outside. */
struct instant {
    uint32_t wraps; /* of the timer, one every 32.768 ms */
    uint16_t ticks; /* half microseconds */
};

/* Starts the clock, and sample ticks every `period` half microseconds. */
void clock_start(uint16_t period);

/* The next sample tick comes one new period from now. */
void clock_set_period(uint16_t period);

/* Now, from the main loop. */
struct instant clock_now(void);

/* Now, from an interrupt: interrupts must be off. */
struct instant clock_now_in_interrupt(void);

/* Microseconds since power-up: the 47 bits last 4.4 years. */
static inline uint64_t clock_us(struct instant at)
{
    return ((uint64_t)at.wraps << 15) + (at.ticks >> 1);
}

/* Takes the sample tick that has come, if one has, and when it was due. */
bool clock_take_tick(struct instant *due);

/* Takes one of the beats that have come: one every 25 ms, for what happens less often than a sample. */
bool clock_take_beat(void);

/* Sample ticks that nobody took before the next one came, modulo 65536. */
uint16_t clock_missed_ticks(void);

#endif
