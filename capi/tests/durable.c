/* A durable run whose process dies in the middle of an operation. Each life is a child of this process. */
#include "esl.h"
#include <assert.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static const char *const PROGRAM =
    "(defvar *total* (count-to 5))\n"
    "(handler-case (shove)\n"
    "  (failure (failure) (note (string (failure-cause failure)))))\n"
    "(exit *total*)";

/* The step at which this process dies: before the state is saved, behind that, or in `shove`. */
static int64_t dies_before, dies_behind;
static bool dies_in_shove;
static const char *log_file;

static void note_line(const char *line) {
    FILE *file = fopen(log_file, "a");
    assert(file);
    fprintf(file, "%s\n", line);
    fclose(file);
}

static void *count(void *data) {
    esl_operation *operation = data;
    int64_t goal, done = 0;
    size_t length = 0;
    const void *kept = esl_operation_restore(operation, &length);
    if (kept) {
        assert(length == sizeof done);
        memcpy(&done, kept, sizeof done);
    }
    assert(strlen(esl_operation_action(operation)) == 32);
    assert(esl_value_integer(esl_operation_argument(operation, 0), &goal));
    while (done < goal) {
        char line[32];
        snprintf(line, sizeof line, "%d", (int)++done);
        note_line(line);
        if (done == dies_before) raise(SIGKILL);
        assert(esl_operation_save(operation, &done, sizeof done) == ESL_OK);
        if (done == dies_behind) raise(SIGKILL);
    }
    esl_value *value = esl_integer(done);
    esl_operation_complete(operation, value);
    esl_value_free(value);
    return NULL;
}

static void begin_count(void *user, esl_operation *operation) {
    (void)user;
    pthread_t thread;
    pthread_create(&thread, NULL, count, operation);
    pthread_detach(thread);
}

static void begin_shove(void *user, esl_operation *operation) {
    (void)user;
    note_line("shove");
    if (dies_in_shove) raise(SIGKILL);
    esl_operation_complete(operation, NULL);
}

static esl_failure *note(void *user, const esl_value *const *arguments, size_t length, esl_value **result) {
    (void)user, (void)length, (void)result;
    char *text = esl_value_print(arguments[0]);
    note_line(text);
    esl_text_free(text);
    return NULL;
}

static esl_failure *failure;

/* Ends the process with the failure of a call that has one. */
static void check(esl_status status) {
    if (status == ESL_OK) return;
    fprintf(stderr, "%s\n", esl_failure_report(failure));
    exit(1);
}

/* Makes the run of a folder, with its functions. */
static esl_durable *made(const char *folder) {
    esl_durable *durable;
    check(esl_durable_new(folder, NULL, &durable, &failure));
    check(esl_durable_define_operation(durable, "count-to", "(n)", "Counts.", ESL_ONCE, begin_count, NULL, NULL,
                                       &failure));
    check(esl_durable_define_operation(durable, "shove", "()", "Shoves.", ESL_ONCE, begin_shove, NULL, NULL, &failure));
    check(esl_durable_define(durable, "note", "(text)", "Notes.", ESL_IDEMPOTENT, note, NULL, NULL, &failure));
    return durable;
}

/* A second run of a folder that is in use is refused. */
static void refuse_second(const char *folder) {
    esl_durable *second = made(folder);
    assert(esl_durable_open(second, "count.esl", PROGRAM, &failure) == ESL_NOT_DURABLE);
    assert(strstr(esl_failure_message(failure), "in use"));
    esl_failure_free(failure);
    assert(esl_durable_free(second) == ESL_OK);
}

static int life(const char *folder, unsigned number) {
    esl_durable *durable = made(folder);
    check(esl_durable_set_power(durable, true, &failure));
    assert(esl_durable_set_snapshots(durable, "soon", &failure) == ESL_INVALID_ARGUMENT);
    esl_failure_free(failure);
    check(esl_durable_open(durable, "count.esl", PROGRAM, &failure));
    assert(esl_durable_set_power(durable, true, NULL) == ESL_INVALID_ARGUMENT);
    if (number == 4) refuse_second(folder);
    esl_durable_ending ending;
    check(esl_durable_run(durable, &ending, &failure));
    /* A process that dies while it repeats the journal is not counted. */
    assert(esl_durable_resumed(durable, NULL) > 1);
    assert(esl_durable_run(durable, &ending, NULL) == ESL_ENDED);
    assert(!ending.is_paused && esl_durable_free(durable) == ESL_OK);
    return ending.exit_status;
}

int main(int count, char **arguments) {
    assert(count == 3);
    log_file = arguments[2];
    static const struct { int64_t before, behind; bool in_shove; } deaths[] = {{0, 2, 0}, {3, 0, 0}, {0, 0, 1}, {0, 0, 0}};
    for (unsigned number = 1; number <= 4; number++) {
        dies_before = deaths[number - 1].before;
        dies_behind = deaths[number - 1].behind;
        dies_in_shove = deaths[number - 1].in_shove;
        pid_t child = fork();
        if (child == 0) _exit(life(arguments[1], number));
        int status;
        assert(waitpid(child, &status, 0) == child);
        if (number < 4) {
            assert(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
        } else {
            assert(WIFEXITED(status));
            printf("%d\n", WEXITSTATUS(status));
        }
    }
}
