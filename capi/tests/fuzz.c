/* Random sequences of calls: whatever comes in whatever order gets a status. Arguments: the number of calls and a
   seed; the same ones make the same calls. Null pointers are among the arguments; in builds of the library with
   debug assertions, objects that were freed before, too. */
#include "esl.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t state;
static long faults = 0, calls = 0, refused = 0;

static uint64_t below(uint64_t limit) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return (state >> 11) % limit;
}

#define SIZE 16
#define POOL(type) static struct { type *live[SIZE], *freed[SIZE]; } type##s

POOL(esl_engine);
POOL(esl_config);
POOL(esl_value);
POOL(esl_handle);
POOL(esl_reply);
POOL(esl_task);
POOL(esl_recording);
POOL(esl_watch);

/* An object of a pool: now and then null, or one that was freed. */
#define ANY(type) ((type *)any((void **)type##s.live, (void **)type##s.freed))
#define PLACE(type) (below(SIZE))

static void *any(void **live, void **freed) {
    uint64_t kind = below(40);
    if (kind == 0) return NULL;
#ifdef ESL_CHECKS_FREED
    if (kind == 1) return freed[below(SIZE)];
#else
    (void)freed;
#endif
    return live[below(SIZE)];
}

/* A value that lives: parts of values cannot be told from freed ones. */
static esl_value *live_value(void) { return esl_values.live[below(SIZE)]; }

static void check(esl_status status, esl_failure *failure) {
    int is_whole = status == ESL_OK || status == ESL_PENDING ? failure == NULL
                                                             : failure != NULL && esl_failure_status(failure) == status;
    if (!is_whole || status == ESL_PANIC) {
        printf("call %ld: status %d, %s\n", calls, status, failure ? esl_failure_message(failure) : "no failure");
        faults++;
    }
    if (failure) {
        esl_frame frame;
        size_t length = strlen(esl_failure_cause(failure)) * strlen(esl_failure_message(failure));
        for (size_t i = 0; esl_failure_frame(failure, i, &frame); i++) length += strlen(frame.function);
        if (length == 0) printf("call %ld: an empty failure\n", calls), faults++;
        refused++;
    }
    esl_failure_free(failure);
}

static void drop(void *user) { ++*(long *)user; }
static long dropped = 0;

static esl_failure *function(void *user, const esl_value *const *arguments, size_t count, esl_value **result) {
    (void)user;
    if (below(3) == 0) return esl_failure_new("refused", arguments, count);
    if (below(3) > 0 && count > 0) *result = esl_value_copy(arguments[below(count)]);
    return NULL;
}

/* Operations that another thread ends; of all others the end is in their beginning. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static esl_operation *queue[SIZE];
static int is_over = 0;

static void end(esl_operation *operation, uint64_t how) {
    esl_value *value = esl_string("done");
    if (how > 2) esl_operation_report_progress(operation, value);
    if (how == 0) esl_operation_free(operation);
    else if (how == 1) esl_operation_fail(operation, esl_failure_new("broken", NULL, 0));
    else esl_operation_complete(operation, value);
    esl_value_free(value);
}

static void *work(void *argument) {
    (void)argument;
    pthread_mutex_lock(&lock);
    for (uint64_t how = 0; !is_over; how = (how + 1) % 5) {
        esl_operation *operation = NULL;
        for (int i = 0; i < SIZE && !operation; i++) operation = queue[i], queue[i] = NULL;
        if (!operation) {
            pthread_cond_wait(&changed, &lock);
            continue;
        }
        pthread_mutex_unlock(&lock);
        end(operation, how);
        pthread_mutex_lock(&lock);
    }
    pthread_mutex_unlock(&lock);
    return NULL;
}

static void come(void *user) { *(long *)user += 0; }

static void cancel(void *user) { *(long *)user += 0; }

static void begin(void *user, esl_operation *operation) {
    if (below(3) == 0) esl_operation_on_cancel(operation, cancel, user, NULL);
    if (below(2)) {
        pthread_mutex_lock(&lock);
        for (int i = 0; i < SIZE && operation; i++) {
            if (!queue[i]) queue[i] = operation, operation = NULL;
        }
        pthread_cond_signal(&changed);
        pthread_mutex_unlock(&lock);
    }
    if (operation) end(operation, below(5));
}

static void observe(void *user, const esl_seen *seen) { *(long *)user += strlen(seen->text) > 1000; }
static void print(void *user, const char *bytes, size_t length) { *(long *)user += bytes[length - 1] == 0; }

static void watched(void *user, bool is_there, const esl_value *fact, const esl_value *bindings) {
    *(long *)user += is_there && esl_value_count(fact) < esl_value_count(bindings) / 2;
}

static const char *const texts[] = {
    "(+ 1 2)", "(fail :lost 1 \"two\")", "(list 1", "(defun f (x) (list x x))", "(sleep 0.0001)", "(loop repeat 30000)", "(assert '(at rover ridge))",
    "(define-input commands :capacity 2 :when-full :drop-oldest)", "(define-property charge ())",
    "(spawn (:daemon t) (loop (sleep 0.001)))", "(f 1)", "(ignore-errors (f 1 2))", "(princ 'x)", "(random 10)",
    "(defun g (&rest all) all)", "(start (work 1))", "(exit 3)", "(error \"no\")", "(make-event)", "#(1 2.5 a)",
    "(retract '(at rover ridge))", "(let ((a (list 1))) (rplacd a a))", "\xFF", "",
};
static const char *const names[] = {"f", "g", "commands", "charge", "work", "list", "no-such-name", "a b", ""};

#define TEXT (below(60) ? texts[below(sizeof texts / sizeof *texts)] : NULL)
#define NAME (below(60) ? names[below(sizeof names / sizeof *names)] : NULL)

/* Puts an object into a pool, in place of another one. */
#define KEEP(type, object)                                              \
    do {                                                                \
        type *kept = (object);                                          \
        size_t place = PLACE(type);                                     \
        if (kept) {                                                     \
            type *before = type##s.live[place];                         \
            type##s.live[place] = kept;                                 \
            type##s.freed[place] = before;                              \
            if (before) type##_free(before);                            \
        }                                                               \
    } while (0)

static void one_call(void) {
    esl_failure *failure = NULL;
    esl_status status = ESL_OK;
    esl_value *value = NULL;
    esl_reply *reply = NULL;
    esl_progress progress;
    const esl_value *arguments[] = {live_value(), live_value()};
    size_t count = below(3);
    switch (below(41)) {
    case 0: {
        esl_engine *engine = NULL;
        if (below(8)) break;
        status = esl_engine_new(ANY(esl_config), &engine, &failure);
        KEEP(esl_engine, engine);
        break;
    }
    case 1: KEEP(esl_config, esl_config_new()); break;
    case 2: status = esl_config_allow(ANY(esl_config), below(2) ? "env=HOME" : TEXT, &failure); break;
    case 3: {
        esl_config *config = ANY(esl_config);
        esl_config_set_seed(config, below(9));
        esl_config_set_virtual_time(config, below(2));
        esl_config_set_recording(config, below(2));
        esl_config_set_ticks(config, 1000 + below(20000));
        break;
    }
    case 4: status = esl_config_set_output(ANY(esl_config), below(5) ? print : NULL, &dropped, drop, &failure); break;
    case 5: {
        esl_recording *recording = NULL;
        status = esl_engine_recording(ANY(esl_engine), &recording, &failure);
        KEEP(esl_recording, recording);
        break;
    }
    case 6: {
        esl_handle *handle = NULL;
        status = esl_engine_handle(ANY(esl_engine), &handle, &failure);
        KEEP(esl_handle, handle);
        break;
    }
    case 7: KEEP(esl_handle, esl_handle_copy(ANY(esl_handle))); break;
    case 8: case 9: case 10: case 11:
        status = esl_eval(ANY(esl_engine), TEXT, below(5) ? &value : NULL, &failure);
        break;
    case 12: status = esl_load(ANY(esl_engine), TEXT, &value, &failure); break;
    case 13: case 14: status = esl_call(ANY(esl_engine), NAME, arguments, count, &value, &failure); break;
    case 15: status = esl_begin(ANY(esl_engine), TEXT, &reply, &failure); break;
    case 16: case 17: case 18: status = esl_poll(ANY(esl_engine), below(5000), &progress, &failure); break;
    case 19:
        status = esl_define(ANY(esl_engine), NAME, below(4) ? "(&rest all)" : TEXT, "A function.",
                            below(9) ? function : NULL, &dropped, drop, &failure);
        break;
    case 20:
        status = esl_define_operation(ANY(esl_engine), NAME, "(n)", "An operation.", below(9) ? begin : NULL, &dropped,
                                      drop, &failure);
        break;
    case 21: status = esl_handle_signal(ANY(esl_handle), NAME, arguments, count, false, &failure); break;
    case 22: status = esl_handle_assert(ANY(esl_handle), live_value(), &reply, &failure); break;
    case 23: status = esl_handle_retract(ANY(esl_handle), live_value(), below(2) ? &reply : NULL, &failure); break;
    case 24: status = esl_handle_query(ANY(esl_handle), live_value(), &reply, &failure); break;
    case 25: status = esl_handle_set(ANY(esl_handle), NAME, arguments, count, live_value(), &reply, &failure); break;
    case 26: status = esl_handle_call(ANY(esl_handle), NAME, arguments, count, &reply, &failure); break;
    case 27: {
        esl_task *task = NULL;
        status = esl_handle_spawn(ANY(esl_handle), NAME, arguments, count, &task, &failure);
        KEEP(esl_task, task);
        break;
    }
    case 28:
        switch (below(3)) {
        case 0: status = esl_handle_tasks(ANY(esl_handle), &reply, &failure); break;
        case 1: esl_handle_abort(ANY(esl_handle), below(40)); break;
        default: esl_task_abort(ANY(esl_task));
        }
        break;
    case 29: {
        esl_watch *watch = NULL;
        status = esl_handle_subscribe(ANY(esl_handle), below(3) ? observe : NULL, &dropped, drop,
                                      below(2) ? &watch : NULL, &failure);
        esl_watch_free(watch);
        break;
    }
    case 30: {
        /* An evaluation of a run that is paused waits. */
        esl_handle *handle = ANY(esl_handle);
        esl_handle_pause(handle), esl_handle_resume(handle);
        if (below(4) == 0) esl_handle_stop(handle);
        break;
    }
    case 31: status = esl_reply_take(ANY(esl_reply), &value, &failure); break;
    case 32: status = esl_reply_on_answer(ANY(esl_reply), below(9) ? come : NULL, &dropped, drop, &failure); break;
    case 33: status = esl_value_of_json(below(2) ? "{\"a\": [1, 2.5]}" : TEXT, &value, &failure); break;
    case 34: {
        char *json = NULL;
        status = esl_value_json(live_value(), &json, &failure);
        esl_text_free(json);
        break;
    }
    case 35: status = esl_value_read(TEXT, &value, &failure); break;
    case 36:
        switch (below(7)) {
        case 0: value = esl_integer((int64_t)below(100)); break;
        case 1: value = esl_string(TEXT); break;
        case 2: value = esl_list(arguments, count); break;
        case 3: value = esl_object("THING", "", &dropped, drop); break;
        case 4: value = esl_float(0.5); break;
        case 5: value = esl_table(arguments, count / 2); break;
        default: value = esl_vector(arguments, count);
        }
        break;
    case 37: {
        const esl_value *item = live_value();
        char *text = esl_value_print(item), *name = esl_value_text(item);
        for (size_t i = 0; i < esl_value_count(item) && i < 5; i++) esl_value_kind(esl_value_item(item, i));
        if (below(5) == 0) esl_object_close(item);
        esl_text_free(text), esl_text_free(name);
        break;
    }
    case 38:
        if (below(2)) status = esl_patch(ANY(esl_engine), "patch", TEXT, NULL, &failure);
        else if (below(2)) status = esl_undo_patch(ANY(esl_engine), NULL, &failure);
        else status = esl_definitions(ANY(esl_engine), below(2) ? "esl-user" : NAME, &value, &failure);
        break;
    case 39: {
        esl_watch *watch = NULL;
        status = esl_watch_facts(ANY(esl_engine), live_value(), below(5) ? watched : NULL, &dropped, drop, &watch,
                                 &failure);
        KEEP(esl_watch, watch);
        break;
    }
    default: {
        int descriptor = -1;
        if (below(4)) status = esl_wakeup_fd(ANY(esl_engine), &descriptor, &failure);
        else status = esl_config_set_replay(ANY(esl_config), ANY(esl_recording), &failure);
    }
    }
    check(status, failure);
    KEEP(esl_value, value);
    KEEP(esl_reply, reply);
}

#define FREE_ALL(type)                                                                   \
    for (size_t i = 0; i < SIZE; i++) {                                                  \
        if (type##s.live[i]) type##_free(type##s.live[i]);                               \
    }

int main(int count, char **arguments) {
    long wanted = count > 1 ? atol(arguments[1]) : 10000;
    state = count > 2 ? strtoull(arguments[2], NULL, 10) : 1997;
    if (state == 0) state = 1;
    pthread_t worker;
    pthread_create(&worker, NULL, work, NULL);
    for (calls = 0; calls < wanted && faults < 20; calls++) one_call();
    /* In no order: a handle outlives its engine. */
    FREE_ALL(esl_recording);
    FREE_ALL(esl_watch);
    FREE_ALL(esl_engine);
    FREE_ALL(esl_value);
    FREE_ALL(esl_handle);
    FREE_ALL(esl_reply);
    FREE_ALL(esl_task);
    FREE_ALL(esl_config);
    pthread_mutex_lock(&lock);
    is_over = 1;
    pthread_cond_signal(&changed);
    pthread_mutex_unlock(&lock);
    pthread_join(worker, NULL);
    fprintf(stderr, "%ld calls, %ld refused\n", calls, refused);
    printf("%ld faults\n", faults);
    return faults != 0;
}
