/* The main loop, as on a board without an operating system: frames, milliseconds, frames. */
#ifndef LOOP_H
#define LOOP_H

/* Runs the firmware on a port that is open, until its bus is gone. */
void loop_run(void);

#endif
