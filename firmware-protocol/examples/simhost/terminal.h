/* The pseudo terminal that stands for the device's serial port. */
#ifndef TERMINAL_H
#define TERMINAL_H

#include <stdbool.h>
#include <stddef.h>

struct terminal {
    int master;
    char name[64];         /* of the other end: /dev/pts/N */
    const char *link_name; /* symbolic link to it */
    bool in_use;           /* somebody has the other end open */
    bool opened;           /* since terminal_was_opened was last asked */
    unsigned char pending[4096];
    size_t pending_length;
    unsigned long sent_bytes;
    unsigned long dropped_bytes; /* the other end was open and full */
    unsigned long unheard_bytes; /* nobody had it open: a real line loses them as well */
};

/* Opens the terminal in raw mode and names it. Prints what is wrong and gives false where it cannot. */
bool terminal_open(struct terminal *terminal, const char *link_name);

/* True when the other end has been opened since the last call. */
bool terminal_was_opened(struct terminal *terminal);

/* A byte for the other end; terminal_flush hands it over. */
void terminal_put(struct terminal *terminal, unsigned char byte);

/* False if the other end is full; what it did not take still waits. Nothing goes to an end that has been opened and not
 * yet been noticed by terminal_was_opened. */
bool terminal_flush(struct terminal *terminal);

/* Gives up on what still waits, and counts it. */
void terminal_drop(struct terminal *terminal);

/* Bytes from the other end, 0 if there are none. */
size_t terminal_read(struct terminal *terminal, unsigned char *bytes, size_t size);

/* Removes the link, if it is still ours, and closes. */
void terminal_close(struct terminal *terminal);

#endif
