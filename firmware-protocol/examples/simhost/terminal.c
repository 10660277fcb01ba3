#define _GNU_SOURCE
#include "terminal.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

static bool failed(const char *what, const char *name)
{
    fprintf(stderr, "simhost: %s %s: %s\n", what, name, strerror(errno));
    return false;
}

/* Raw mode, set through the other end: it stays when that is closed again. */
static bool make_raw(const char *name)
{
    int other_end = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (other_end < 0)
        return failed("cannot open the terminal", name);
    struct termios mode;
    bool done = tcgetattr(other_end, &mode) == 0;
    cfmakeraw(&mode);
    done = done && tcsetattr(other_end, TCSANOW, &mode) == 0;
    if (!done)
        failed("cannot set the terminal", name);
    close(other_end);
    return done;
}

/* An old link is replaced, a file never. */
static bool name_it(const char *name, const char *link_name)
{
    char old[1];
    if (readlink(link_name, old, sizeof old) >= 0)
        unlink(link_name);
    return symlink(name, link_name) == 0 || failed("cannot make the link", link_name);
}

bool terminal_open(struct terminal *terminal, const char *link_name)
{
    *terminal = (struct terminal){.link_name = link_name};
    terminal->master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (terminal->master < 0 || grantpt(terminal->master) || unlockpt(terminal->master)
        || ptsname_r(terminal->master, terminal->name, sizeof terminal->name)
        || fcntl(terminal->master, F_SETFL, O_NONBLOCK))
        return failed("cannot make", "a pseudo terminal");
    return make_raw(terminal->name) && name_it(terminal->name, link_name);
}

/* Once the other end has been open, Linux reports a hang-up for as long as it is closed. */
static void look(struct terminal *terminal)
{
    struct pollfd state = {.fd = terminal->master};
    bool was_in_use = terminal->in_use;
    poll(&state, 1, 0);
    terminal->in_use = !(state.revents & POLLHUP);
    terminal->opened = terminal->opened || (terminal->in_use && !was_in_use);
}

bool terminal_was_opened(struct terminal *terminal)
{
    look(terminal);
    bool opened = terminal->opened;
    terminal->opened = false;
    return opened;
}

void terminal_put(struct terminal *terminal, unsigned char byte)
{
    if (terminal->pending_length < sizeof terminal->pending)
        terminal->pending[terminal->pending_length++] = byte;
    else
        terminal->dropped_bytes++;
}

bool terminal_flush(struct terminal *terminal)
{
    look(terminal);
    if (!terminal->in_use || terminal->opened) {
        terminal->unheard_bytes += terminal->pending_length;
        terminal->pending_length = 0;
    } else if (terminal->pending_length > 0) {
        ssize_t written = write(terminal->master, terminal->pending, terminal->pending_length);
        size_t taken = written > 0 ? (size_t)written : 0;
        terminal->sent_bytes += taken;
        terminal->pending_length -= taken;
        memmove(terminal->pending, terminal->pending + taken, terminal->pending_length);
    }
    return terminal->pending_length == 0;
}

void terminal_drop(struct terminal *terminal)
{
    terminal->dropped_bytes += terminal->pending_length;
    terminal->pending_length = 0;
}

size_t terminal_read(struct terminal *terminal, unsigned char *bytes, size_t size)
{
    ssize_t count = read(terminal->master, bytes, size);
    return count > 0 ? (size_t)count : 0;
}

void terminal_close(struct terminal *terminal)
{
    char target[sizeof terminal->name];
    ssize_t length = readlink(terminal->link_name, target, sizeof target);
    if (length == (ssize_t)strlen(terminal->name) && memcmp(target, terminal->name, (size_t)length) == 0)
        unlink(terminal->link_name);
    close(terminal->master);
}
