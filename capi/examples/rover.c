/* An executive in ESL whose hands and eyes are C: the rover drives in a thread of its own, and the main loop
 * waits for ESL and for the rover by `poll`. Each leg is retried after an obstacle; a low battery ends the
 * patrol wherever it is. */
#include "esl.h"

#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static const char *PROGRAM =
    "(define-property battery ())\n"
    "(defun patrol ()\n"
    "  (dotimes (leg 3)\n"
    "    (with-recovery-procedures (((:obstacle metres)\n"
    "                                :retries 2\n"
    "                                (format t \"obstacle after ~d m, once more~%\" metres)\n"
    "                                (retry)))\n"
    "      (format t \"drove ~d m~%\" (drive (* 10 (+ leg 1)))))))\n"
    "(defun mission ()\n"
    "  (pursue (low (wait-until (< (battery) 0.2)) :battery-low)\n"
    "          (patrol (patrol) :all-legs)))\n";

/* Ends the program with the report of a failure. */
static void require_ok(esl_status status, esl_failure *failure) {
    if (status == ESL_OK) return;
    fprintf(stderr, "%s\n", failure ? esl_failure_report(failure) : "no failure");
    esl_failure_free(failure);
    exit(1);
}

static atomic_int legs;

/* The rover: it drives for a while, and meets an obstacle on its first way. */
static void *drive(void *argument) {
    esl_operation *operation = argument;
    int64_t metres = 0;
    esl_value_integer(esl_operation_argument(operation, 0), &metres);
    usleep(1000 * metres);
    if (esl_operation_is_cancelled(operation)) {
        esl_operation_free(operation);
    } else if (atomic_fetch_add(&legs, 1) == 0) {
        esl_value *four = esl_integer(4);
        const esl_value *arguments[] = {four};
        esl_operation_fail(operation, esl_failure_new("obstacle", arguments, 1));
        esl_value_free(four);
    } else {
        esl_value *value = esl_integer(metres);
        esl_operation_complete(operation, value);
        esl_value_free(value);
    }
    return NULL;
}

static void begin_drive(void *user, esl_operation *operation) {
    (void)user;
    pthread_t thread;
    if (pthread_create(&thread, NULL, drive, operation) == 0) {
        pthread_detach(thread);
    } else {
        esl_operation_free(operation);
    }
}

int main(void) {
    esl_failure *failure = NULL;
    esl_engine *engine = NULL;
    require_ok(esl_engine_new(NULL, &engine, &failure), failure);
    require_ok(esl_define_operation(engine, "drive", "(metres)", "Drives that far.", begin_drive, NULL, NULL,
                                    &failure),
               failure);
    require_ok(esl_eval(engine, PROGRAM, NULL, &failure), failure);

    esl_handle *handle = NULL;
    require_ok(esl_engine_handle(engine, &handle, &failure), failure);
    esl_value *charge = esl_float(0.9);
    require_ok(esl_handle_set(handle, "battery", NULL, 0, charge, NULL, &failure), failure);
    esl_value_free(charge);

    esl_reply *mission = NULL;
    require_ok(esl_begin(engine, "(mission)", &mission, &failure), failure);
    struct pollfd wakeup = {.events = POLLIN};
    require_ok(esl_wakeup_fd(engine, &wakeup.fd, &failure), failure);
    esl_value *outcome = NULL;
    esl_status status;
    while ((status = esl_reply_take(mission, &outcome, &failure)) == ESL_PENDING) {
        esl_progress progress;
        require_ok(esl_poll(engine, 10000, &progress, &failure), failure);
        if (progress.state == ESL_WAITING) {
            poll(&wakeup, 1, progress.wait < 0 ? -1 : (int)(progress.wait / 1000000 + 1));
        }
    }
    require_ok(status, failure);
    char *text = esl_value_print(outcome);
    printf("the mission ended with %s\n", text);
    esl_text_free(text);
    esl_value_free(outcome);
    esl_reply_free(mission);
    esl_handle_free(handle);
    esl_engine_free(engine);
    return 0;
}
