/* The device as the host sees it: what it says and what it answers. */
#ifndef DEVICE_H
#define DEVICE_H

#include <stdint.h>

#include "clock.h"
#include "sensor.h"
#include "uart.h"

/* Half microseconds between samples at power-up. */
uint16_t device_first_period(void);

void device_send_hello(void);
void device_send_status(void);
void device_send_text(const char *line);

/* True between start and stop; true at power-up. */
bool device_measures(void);

/* Sends a reading that was due at `due`. */
void device_send_sample(struct instant due, const struct reading *reading);

/* Answers what the host sent. Damaged frames and frames that are no requests are ignored. */
void device_answer(struct uart_frame *frame);

#endif
