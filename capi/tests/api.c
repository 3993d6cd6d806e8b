/* What the API promises, call by call: each check prints its line if it does not hold. */
#include "esl.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static int faults = 0;

#define CHECK(condition)                                                  \
    do {                                                                  \
        if (!(condition)) {                                               \
            printf("line %d: %s\n", __LINE__, #condition);                \
            faults++;                                                     \
        }                                                                 \
    } while (0)

static esl_engine *new_engine(const esl_config *config) {
    esl_engine *engine = NULL;
    CHECK(esl_engine_new(config, &engine, NULL) == ESL_OK);
    return engine;
}

/* Evaluates a text. Returns its value as the program prints it, for `free_text`; or its cause. */
static char *eval(esl_engine *engine, const char *text) {
    esl_value *value = NULL;
    esl_failure *failure = NULL;
    char *printed;
    if (esl_eval(engine, text, &value, &failure) == ESL_OK) {
        printed = esl_value_print(value);
    } else {
        esl_value *cause = esl_string(esl_failure_cause(failure));
        printed = esl_value_text(cause);
        esl_value_free(cause);
    }
    esl_value_free(value);
    esl_failure_free(failure);
    return printed;
}

static int gives(esl_engine *engine, const char *text, const char *expected) {
    char *printed = eval(engine, text);
    int is_equal = printed != NULL && strcmp(printed, expected) == 0;
    if (!is_equal) printf("%s gives %s, not %s\n", text, printed ? printed : "nothing", expected);
    esl_text_free(printed);
    return is_equal;
}

static void values(void) {
    int64_t integer = 0;
    double number = 0;
    size_t length = 0;
    esl_value *value = esl_integer(-5);
    CHECK(esl_value_kind(value) == ESL_INTEGER);
    CHECK(esl_value_integer(value, &integer) && integer == -5);
    CHECK(esl_value_float(value, &number) && number == -5.0);
    CHECK(esl_value_item(value, 0) == NULL && esl_value_count(value) == 0);
    esl_value_free(value);

    const double floats[] = {0.5, -1.0};
    value = esl_floats(floats, 2);
    const double *shown = esl_value_floats(value, &length);
    CHECK(length == 2 && shown[0] == 0.5 && shown[1] == -1.0);
    CHECK(esl_value_bytes(value, &length) == NULL && length == 0);
    esl_value_free(value);

    CHECK(esl_value_read("(1 . 2)", &value, NULL) == ESL_OK);
    CHECK(esl_value_kind(value) == ESL_DOTTED_LIST && esl_value_count(value) == 2);
    CHECK(esl_value_integer(esl_value_item(value, 1), &integer) && integer == 2);
    esl_value_free(value);

    value = esl_string_of_length("a\0b", 3);
    const uint8_t *bytes = esl_value_text_bytes(value, &length);
    CHECK(length == 3 && memcmp(bytes, "a\0b", 3) == 0);
    char *text = esl_value_text(value);
    CHECK(strcmp(text, "a\xEF\xBF\xBD" "b") == 0);
    esl_text_free(text);
    esl_value_free(value);
    CHECK(esl_string("\xFF") == NULL);

    esl_value *items[] = {esl_keyword("on"), esl_symbol("valve"), esl_boolean(true), esl_nil()};
    value = esl_list((const esl_value *const *)items, 4);
    for (int i = 0; i < 4; i++) esl_value_free(items[i]);
    text = esl_value_print(value);
    CHECK(strcmp(text, "(:ON VALVE T NIL)") == 0);
    esl_text_free(text);
    esl_value *copy = esl_value_copy(value);
    esl_value_free(value);
    CHECK(esl_value_count(copy) == 4);
    esl_value_free(copy);

    esl_value *both[] = {esl_string("a"), esl_integer(1), esl_integer(7), esl_nil()};
    value = esl_table((const esl_value *const *)both, 2);
    for (int i = 0; i < 4; i++) esl_value_free(both[i]);
    CHECK(esl_value_kind(value) == ESL_TABLE && esl_value_count(value) == 4);
    CHECK(esl_value_integer(esl_value_item(value, 2), &integer) && integer == 7);
    CHECK(esl_value_item(value, 4) == NULL);
    CHECK(esl_value_json(value, &text, NULL) == ESL_OK && strcmp(text, "{\"a\":1,\"7\":false}") == 0);
    esl_text_free(text);
    esl_value_free(value);
    CHECK(esl_table(NULL, SIZE_MAX) == NULL);
}

/* (add a b), which fails for negative numbers. */
static esl_failure *add(void *user, const esl_value *const *arguments, size_t count, esl_value **result) {
    int64_t a = 0, b = 0;
    *(int *)user += (int)count;
    if (!esl_value_integer(arguments[0], &a) || !esl_value_integer(arguments[1], &b)) {
        return esl_failure_new("not-integers", arguments, count);
    }
    *result = esl_integer(a + b);
    return NULL;
}

static void note_end(void *user) { *(int *)user = -1; }

static esl_failure *call_back(void *user, const esl_value *const *arguments, size_t count, esl_value **result) {
    (void)arguments, (void)count, (void)result;
    esl_failure *failure = NULL;
    CHECK(esl_eval(user, "1", NULL, &failure) == ESL_BUSY);
    CHECK(strstr(esl_failure_message(failure), "use a handle") != NULL);
    CHECK(esl_engine_free(user) == ESL_BUSY);
    return failure;
}

static void functions(void) {
    int user = 0;
    esl_engine *engine = new_engine(NULL);
    CHECK(esl_define(engine, "add", "(a b)", "The sum.", add, &user, note_end, NULL) == ESL_OK);
    CHECK(gives(engine, "(add 40 2)", "42"));
    CHECK(user == 2);
    CHECK(gives(engine, "(add 1 :two)", ":NOT-INTEGERS"));
    CHECK(gives(engine, "(handler-case (add 1 :two) (failure (f) (failure-arguments f)))", "(1 :TWO)"));
    CHECK(esl_define(engine, "again", "()", "", call_back, engine, NULL, NULL) == ESL_OK);
    CHECK(gives(engine, "(again)", ":BUSY"));
    CHECK(gives(engine, "(add 20 2)", "22"));
    int other = 0;
    CHECK(esl_define(engine, "not a name", "()", "", add, &other, note_end, NULL) == ESL_INVALID_ARGUMENT);
    CHECK(other == -1);
    CHECK(esl_engine_free(engine) == ESL_OK);
    CHECK(user == -1);
}

static void failures(void) {
    esl_engine *engine = new_engine(NULL);
    esl_failure *failure = NULL;
    CHECK(esl_eval(engine, "(list 1", NULL, &failure) == ESL_DOES_NOT_COMPILE);
    CHECK(strstr(esl_failure_message(failure), "unclosed-list") != NULL);
    esl_failure_free(failure);

    const char *text = "(defun open-valve (n) (fail :stuck n \"left\") n) (list (open-valve 3))";
    CHECK(esl_eval(engine, text, NULL, &failure) == ESL_FAILED);
    CHECK(strcmp(esl_failure_cause(failure), ":STUCK") == 0);
    CHECK(esl_failure_argument_count(failure) == 2 && esl_failure_argument(failure, 2) == NULL);
    CHECK(esl_value_kind(esl_failure_argument(failure, 1)) == ESL_STRING);
    esl_frame frame;
    size_t index = 0;
    while (esl_failure_frame(failure, index, &frame) && frame.is_of_library) index++;
    CHECK(index < esl_failure_frame_count(failure));
    CHECK(strcmp(frame.function, "OPEN-VALVE") == 0 && strcmp(frame.task, "") != 0);
    CHECK(!esl_failure_frame(failure, 1000, &frame));
    esl_failure_free(failure);
    CHECK(esl_load(engine, "/no/such/file.esl", NULL, &failure) == ESL_UNREADABLE);
    CHECK(strstr(esl_failure_message(failure), "/no/such/file.esl") != NULL);
    esl_failure_free(failure);
    esl_engine_free(engine);
}

static void limits_and_rights(void) {
    esl_config *config = esl_config_new();
    esl_failure *failure = NULL;
    CHECK(esl_config_set_memory(config, 32 << 20) == ESL_OK);
    CHECK(esl_config_set_ticks(config, 100000) == ESL_OK);
    CHECK(esl_config_set_virtual_time(config, true) == ESL_OK);
    CHECK(esl_config_allow(config, "fly=high", &failure) == ESL_INVALID_ARGUMENT);
    CHECK(strstr(esl_failure_message(failure), "`fly` is not a right") != NULL);
    esl_failure_free(failure);
    CHECK(esl_config_allow(config, "env=ESL_TEST", NULL) == ESL_OK);
    esl_engine *engine = new_engine(config);
    esl_config_free(config);
    CHECK(gives(engine, "(loop)", ":BUDGET-SPENT"));
    CHECK(gives(engine, "(progn (sleep 3600) (now))", "3600.0"));
    CHECK(gives(engine, "(wait-for-event (make-event))", ":DEADLOCKED"));
    CHECK(gives(engine, "(with-open-file (s \"/etc/passwd\") (read-line s))", ":PERMISSION-DENIED"));
    esl_engine_free(engine);
}

static int gives_json(const char *text, const char *expected) {
    esl_value *value = NULL;
    char *json = NULL;
    CHECK(esl_value_read(text, &value, NULL) == ESL_OK);
    esl_status status = esl_value_json(value, &json, NULL);
    int is_equal = expected ? json != NULL && strcmp(json, expected) == 0 : status == ESL_NOT_OF_TYPE && !json;
    if (!is_equal) printf("%s gives %s\n", text, json ? json : "nothing");
    esl_text_free(json);
    esl_value_free(value);
    return is_equal;
}

static void json(void) {
    CHECK(gives_json("((\"a\" . 1) (b 2 c) (7))", "{\"a\":1,\"b\":[2,\"c\"],\"7\":false}"));
    CHECK(gives_json("(1 :null :false t nil :on)", "[1,null,false,true,false,\"on\"]"));
    CHECK(gives_json("#(1/2 -0.5d0 1d300 123456789012345678901234567890)",
                     "[0.5,-0.5,1e300,123456789012345678901234567890]"));
    CHECK(gives_json("(\"a\\\"b\" #\\x)", "[\"a\\\"b\",\"x\"]"));
    CHECK(gives_json("(1 . 2)", NULL));
    esl_value *value = esl_float(INFINITY);
    esl_failure *failure = NULL;
    CHECK(esl_value_json(value, NULL, &failure) == ESL_NOT_OF_TYPE);
    CHECK(strstr(esl_failure_message(failure), "JSON") != NULL);
    esl_failure_free(failure);
    esl_value_free(value);
    /* The module of the library agrees. */
    esl_engine *engine = new_engine(NULL);
    CHECK(esl_eval(engine, "(require :json)", NULL, NULL) == ESL_OK);
    const char *texts[] = {"{\"b\": 1, \"a\": [true, false, null, 1.5, -3]}", "[]", "[[], {\"\": \"\\u00e4\"}]",
                           "18446744073709551615", "\"x\""};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        char *program = malloc(1000), *printed, *written, *expected;
        esl_value *text = esl_string(texts[i]), *parsed = NULL;
        char *quoted = esl_value_print(text);
        CHECK(esl_value_of_json(texts[i], &value, NULL) == ESL_OK);
        printed = esl_value_print(value);
        snprintf(program, 1000, "(json:parse %s :objects :alist)", quoted);
        CHECK(gives(engine, program, printed));
        snprintf(program, 1000, "(json:stringify (json:parse %s :objects :alist) :objects :alist)", quoted);
        CHECK(esl_eval(engine, program, &parsed, NULL) == ESL_OK);
        expected = esl_value_text(parsed);
        CHECK(esl_value_json(value, &written, NULL) == ESL_OK);
        CHECK(strcmp(written, expected) == 0);
        esl_text_free(written), esl_text_free(expected), esl_text_free(printed), esl_text_free(quoted);
        esl_value_free(value), esl_value_free(text), esl_value_free(parsed);
        free(program);
    }
    CHECK(esl_value_of_json("{\"a\": }", &value, &failure) == ESL_NOT_OF_TYPE);
    CHECK(strstr(esl_failure_message(failure), "line 1 column 7") != NULL);
    esl_failure_free(failure);
    esl_engine_free(engine);
}

/* Objects of C: a program holds them, until it has lost them. */
static void objects(void) {
    int device = 0, other = 0;
    esl_engine *engine = new_engine(NULL);
    esl_value *value = esl_object("CAMERA", "at 7", &device, note_end);
    const esl_value *arguments[] = {value};
    esl_value *same = NULL;
    CHECK(esl_value_kind(value) == ESL_HOST_OBJECT);
    CHECK(esl_call(engine, "identity", arguments, 1, &same, NULL) == ESL_OK);
    esl_value_free(value);
    CHECK(esl_value_object(same, "CAMERA") == &device && esl_value_object(same, "MOTOR") == NULL);
    char *text = esl_value_print(same);
    CHECK(strcmp(text, "#<CAMERA at 7>") == 0);
    esl_text_free(text);
    CHECK(device == 0 && esl_object_close(same) && device == -1 && !esl_object_close(same));
    CHECK(esl_value_object(same, "CAMERA") == NULL);
    esl_value_free(same);
    CHECK(esl_object("CAMERA", NULL, &other, note_end) == NULL && other == -1);
    esl_engine_free(engine);
}

struct seen_events {
    int facts, failures, ends;
    char output[100];
};

static void observe(void *user, const esl_seen *seen) {
    struct seen_events *events = user;
    if (seen->event == ESL_FACT_ASSERTED) events->facts += strstr(seen->text, "RIDGE") != NULL;
    if (seen->event == ESL_TASK_FAILS) events->failures += strcmp(seen->text, "LOST") == 0 || strcmp(seen->text, ":LOST") == 0;
    if (seen->event == ESL_TASK_ENDS) events->ends++;
}

static void print(void *user, const char *bytes, size_t length) {
    struct seen_events *events = user;
    strncat(events->output, bytes, length);
}

/* A run that is watched, recorded, and replayed without its outside. */
static void watching(void) {
    struct seen_events events = {0}, repeated = {0};
    int user = 0;
    esl_config *config = esl_config_new();
    CHECK(esl_config_set_output(config, print, &events, NULL, NULL) == ESL_OK);
    CHECK(esl_config_set_recording(config, true) == ESL_OK);
    esl_engine *engine = new_engine(config);
    esl_handle *handle = NULL;
    CHECK(esl_engine_handle(engine, &handle, NULL) == ESL_OK);
    esl_watch *watch = NULL;
    CHECK(esl_handle_subscribe(handle, observe, &events, NULL, NULL, NULL) == ESL_OK);
    CHECK(esl_handle_subscribe(handle, NULL, NULL, NULL, &watch, NULL) == ESL_INVALID_ARGUMENT && !watch);
    CHECK(esl_define(engine, "add", "(a b)", "The sum.", add, &user, NULL, NULL) == ESL_OK);
    const char *text = "(progn (assert '(at rover ridge)) (handler-case (fail :lost) (failure () nil)) (princ (add 40 2))"
                       "       (list (random 1000) (get-universal-time)))";
    char *first = eval(engine, text);
    CHECK(events.facts == 1 && events.failures == 1 && strcmp(events.output, "42") == 0);
    esl_recording *recording = NULL;
    CHECK(esl_engine_recording(engine, &recording, NULL) == ESL_OK);
    CHECK(esl_config_set_replay(config, recording, NULL) == ESL_OK);
    CHECK(esl_config_set_output(config, print, &repeated, NULL, NULL) == ESL_OK);
    esl_recording_free(recording);
    esl_engine *replay = new_engine(config);
    CHECK(esl_engine_recording(replay, &recording, NULL) == ESL_INVALID_ARGUMENT);
    user = 0;
    CHECK(esl_define(replay, "add", "(a b)", "The sum.", add, &user, NULL, NULL) == ESL_OK);
    CHECK(gives(replay, text, first) && user == 0 && strcmp(repeated.output, "42") == 0);
    CHECK(esl_engine_canary(replay) == esl_engine_canary(engine) && esl_engine_canary(NULL) == 0);
    esl_text_free(first);
    esl_handle_free(handle);
    esl_engine_free(engine);
    esl_engine_free(replay);
    esl_config_free(config);
}

/* An observer until its watch is freed, and one until the end of the engine. */
static void watching_for_a_while(void) {
    struct seen_events all = {0}, some = {0};
    esl_engine *engine = new_engine(NULL);
    esl_handle *handle = NULL;
    esl_watch *watch = NULL;
    CHECK(esl_engine_handle(engine, &handle, NULL) == ESL_OK);
    CHECK(esl_handle_subscribe(handle, observe, &all, NULL, NULL, NULL) == ESL_OK);
    CHECK(esl_handle_subscribe(handle, observe, &some, NULL, &watch, NULL) == ESL_OK);
    CHECK(gives(engine, "(assert '(at rover ridge))", "T"));
    esl_watch_free(watch);
    CHECK(gives(engine, "(assert '(at lander ridge))", "T"));
    CHECK(all.facts == 2 && some.facts == 1);
    esl_handle_free(handle);
    esl_engine_free(engine);
}

static atomic_int is_over;

/* Another thread: signals, facts, a call. */
static void *operate(void *argument) {
    esl_handle *handle = argument;
    esl_value *fact = NULL;
    esl_reply *reply = NULL;
    esl_value *answer = NULL;
    esl_value_read("(at rover ridge)", &fact, NULL);
    CHECK(esl_handle_assert(handle, fact, &reply, NULL) == ESL_OK);
    CHECK(esl_reply_wait(reply, &answer, NULL) == ESL_OK && esl_value_is_true(answer));
    esl_value_free(answer);
    CHECK(esl_reply_wait(reply, &answer, NULL) == ESL_ENDED);
    esl_reply_free(reply);
    esl_value_free(fact);

    esl_value_read("(at ?robot ?place)", &fact, NULL);
    CHECK(esl_handle_query(handle, fact, &reply, NULL) == ESL_OK);
    CHECK(esl_reply_wait(reply, &answer, NULL) == ESL_OK);
    char *text = esl_value_print(answer);
    CHECK(strcmp(text, "((:ROBOT ROVER :PLACE RIDGE))") == 0);
    esl_text_free(text);
    esl_value_free(answer);
    esl_reply_free(reply);
    esl_value_free(fact);

    esl_value *seven = esl_integer(7);
    const esl_value *arguments[] = {seven};
    CHECK(esl_handle_call(handle, "double", arguments, 1, &reply, NULL) == ESL_OK);
    CHECK(esl_reply_wait(reply, &answer, NULL) == ESL_OK);
    CHECK(esl_handle_signal(handle, "no-such-input", arguments, 1, true, NULL) == ESL_INVALID_ARGUMENT);
    const esl_value *doubled[] = {answer};
    CHECK(esl_handle_signal(handle, "commands", doubled, 1, true, NULL) == ESL_OK);
    esl_value_free(answer);
    esl_value_free(seven);
    esl_reply_free(reply);

    esl_task *task = NULL;
    CHECK(esl_handle_spawn(handle, "patrol", NULL, 0, &task, NULL) == ESL_OK);
    CHECK(esl_task_abort(task) == ESL_OK);
    reply = esl_task_into_reply(task);
    CHECK(esl_reply_wait(reply, &answer, NULL) == ESL_ABORTED);
    esl_reply_free(reply);

    /* A task by its number: that of the list's last row, the newest task. */
    CHECK(esl_handle_spawn(handle, "patrol", NULL, 0, &task, NULL) == ESL_OK);
    CHECK(esl_handle_tasks(handle, &reply, NULL) == ESL_OK);
    CHECK(esl_reply_wait(reply, &answer, NULL) == ESL_OK);
    esl_reply_free(reply);
    int64_t number = 0;
    const esl_value *row = esl_value_item(answer, esl_value_count(answer) - 1);
    char *key = esl_value_print(esl_value_item(row, 0));
    CHECK(strcmp(key, ":NUMBER") == 0 && esl_value_integer(esl_value_item(row, 1), &number));
    esl_text_free(key);
    esl_value_free(answer);
    CHECK(esl_handle_abort(handle, (uint64_t)number) == ESL_OK);
    reply = esl_task_into_reply(task);
    CHECK(esl_reply_wait(reply, &answer, NULL) == ESL_ABORTED);
    esl_reply_free(reply);
    esl_handle_free(handle);
    atomic_store(&is_over, 1);
    return NULL;
}

static void threads(void) {
    esl_engine *engine = new_engine(NULL);
    CHECK(gives(engine,
                "(progn (define-input commands :capacity 9) (defun double (n) (* 2 n))"
                "       (defun patrol () (loop (sleep 0.01))) 1)",
                "1"));
    esl_handle *handle = NULL;
    CHECK(esl_engine_handle(engine, &handle, NULL) == ESL_OK);
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, operate, esl_handle_copy(handle)) == 0);
    CHECK(gives(engine, "(wait-for-event commands)", "14"));
    esl_handle_free(handle);
    /* An engine answers only while it runs. */
    esl_progress progress = {ESL_DONE, 0, -1};
    while (!atomic_load(&is_over)) CHECK(esl_run(engine, &progress, NULL) == ESL_OK);
    CHECK(progress.state == ESL_DONE);
    pthread_join(thread, NULL);
    esl_engine_free(engine);
}

/* What bad use gets: a status, and a text that says what to do. */
static void bad_use(void) {
    esl_failure *failure = NULL;
    CHECK(esl_eval(NULL, "1", NULL, &failure) == ESL_INVALID_ARGUMENT);
    CHECK(strstr(esl_failure_message(failure), "`esl_engine`") != NULL);
    esl_failure_free(failure);
    esl_engine *engine = new_engine(NULL);
    CHECK(esl_eval(engine, NULL, NULL, NULL) == ESL_INVALID_ARGUMENT);
    CHECK(esl_eval(engine, "\xFF", NULL, NULL) == ESL_INVALID_ARGUMENT);
    CHECK(esl_call(engine, "list", NULL, 3, NULL, NULL) == ESL_INVALID_ARGUMENT);
    CHECK(esl_define(engine, "f", "()", "", NULL, NULL, NULL, NULL) == ESL_INVALID_ARGUMENT);
    esl_reply *reply = NULL;
    esl_handle *handle = NULL;
    CHECK(esl_begin(engine, "(list 1)", &reply, NULL) == ESL_OK);
    CHECK(esl_reply_take(reply, NULL, NULL) == ESL_PENDING);
    CHECK(esl_engine_handle(engine, &handle, NULL) == ESL_OK);
    CHECK(esl_engine_free(engine) == ESL_OK);
    CHECK(esl_reply_wait(reply, NULL, NULL) == ESL_ENDED);
    esl_reply_free(reply);
    esl_value *value = esl_integer(1);
    CHECK(esl_handle_signal(handle, "x", NULL, 0, true, NULL) != ESL_OK);
    CHECK(esl_handle_pause(handle) == ESL_OK);
    esl_handle_free(handle);
#ifdef ESL_CHECKS_FREED
    CHECK(esl_eval(engine, "1", NULL, &failure) == ESL_INVALID_ARGUMENT);
    CHECK(strstr(esl_failure_message(failure), "freed before") != NULL);
    esl_failure_free(failure);
    CHECK(esl_engine_free(engine) == ESL_INVALID_ARGUMENT);
    esl_value_free(value);
#endif
    esl_value_free(value);
}

static void *call_meanwhile(void *engine) {
    esl_failure *failure = NULL;
    esl_status status = esl_eval(engine, "1", NULL, &failure);
    CHECK(status == ESL_BUSY && strstr(esl_failure_message(failure), "one thread at a time") != NULL);
    esl_failure_free(failure);
    return NULL;
}

static esl_failure *let_another_call(void *user, const esl_value *const *arguments, size_t count, esl_value **result) {
    (void)arguments, (void)count, (void)result;
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, call_meanwhile, user) == 0);
    pthread_join(thread, NULL);
    return NULL;
}

static esl_failure *leave(void *user, const esl_value *const *arguments, size_t count, esl_value **result) {
    (void)user, (void)arguments, (void)count, (void)result;
    exit(7);
}

/* Returns the exit status of a child that does something with an engine of this process, or makes one. */
static int in_a_child(esl_engine *engine, esl_reply *reply, int makes_one) {
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
        alarm(60);
        if (makes_one) {
            esl_engine *made = new_engine(NULL);
            CHECK(esl_define(made, "leave", "()", "", leave, NULL, NULL, NULL) == ESL_OK);
            CHECK(gives(made, "(+ 1 2)", "3"));
            eval(made, "(unwind-protect (leave) (princ 'no))");
            _exit(1);
        }
        esl_failure *failure = NULL;
        CHECK(esl_eval(engine, "1", NULL, &failure) == ESL_ENDED);
        CHECK(strstr(esl_failure_message(failure), "after the fork") != NULL);
        esl_failure_free(failure);
        CHECK(esl_reply_wait(reply, NULL, NULL) == ESL_ENDED);
        esl_reply_free(reply);
        CHECK(esl_engine_free(engine) == ESL_OK);
        fflush(stdout);
        _exit(faults != 0);
    }
    int status = -1;
    CHECK(child > 0 && waitpid(child, &status, 0) == child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* Calls from a second thread during a call, after a fork, and an end of the process within a call. */
static void processes(void) {
    esl_engine *engine = new_engine(NULL);
    esl_reply *reply = NULL;
    CHECK(esl_define(engine, "meanwhile", "()", "", let_another_call, engine, NULL, NULL) == ESL_OK);
    CHECK(gives(engine, "(progn (meanwhile) 5)", "5"));
    CHECK(esl_begin(engine, "(list 1)", &reply, NULL) == ESL_OK);
    CHECK(in_a_child(engine, reply, 0) == 0);
    CHECK(in_a_child(NULL, NULL, 1) == 7);
    CHECK(gives(engine, "(+ 1 2)", "3"));
    esl_reply_free(reply);
    esl_engine_free(engine);
}

/* Many engines, made and dropped. */
static void engines(void) {
    for (int i = 0; i < 20; i++) {
        esl_engine *engine = new_engine(NULL);
        CHECK(gives(engine, "(+ 1 2)", "3"));
        CHECK(esl_engine_free(engine) == ESL_OK);
    }
}

int main(void) {
    CHECK(strlen(esl_version()) >= 5);
    values();
    functions();
    failures();
    limits_and_rights();
    json();
    objects();
    watching();
    watching_for_a_while();
    threads();
    bad_use();
    processes();
    engines();
    printf("%d faults\n", faults);
    return faults != 0;
}
