/* Calls of a function in ESL from C, which calls a function of C; and engines made and dropped. Prints
 * nanoseconds: of a call, and of an engine. */
#include "esl.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

static void require_ok(esl_status status, esl_failure *failure) {
    if (status == ESL_OK) return;
    fprintf(stderr, "%s\n", failure ? esl_failure_report(failure) : "no failure");
    exit(1);
}

static esl_failure *increment(void *user, const esl_value *const *arguments, size_t count, esl_value **result) {
    int64_t n = 0;
    (void)user;
    if (count == 1) esl_value_integer(arguments[0], &n);
    *result = esl_integer(n + 1);
    return NULL;
}

int main(int count, char **arguments) {
    long calls = count > 1 ? atol(arguments[1]) : 100000, engines = count > 2 ? atol(arguments[2]) : 100;
    esl_failure *failure = NULL;
    esl_engine *engine = NULL;
    require_ok(esl_engine_new(NULL, &engine, &failure), failure);
    require_ok(esl_define(engine, "increment", "(n)", "", increment, NULL, NULL, &failure), failure);
    require_ok(esl_eval(engine, "(defun twice-more (n) (+ 1 (increment n)))", NULL, &failure), failure);
    int64_t n = 0;
    double best = 1e18;
    for (int round = 0; round < 5; round++) {
        double start = now();
        for (long call = 0; call < calls; call++) {
            esl_value *argument = esl_integer(n), *value = NULL;
            const esl_value *list[] = {argument};
            require_ok(esl_call(engine, "twice-more", list, 1, &value, &failure), failure);
            esl_value_integer(value, &n);
            esl_value_free(argument);
            esl_value_free(value);
        }
        double time = (now() - start) / (double)calls;
        if (time < best) best = time;
    }
    if (n != 10 * calls) return 2;
    printf("%.1f\n", best);
    esl_engine_free(engine);
    double start = now();
    for (long made = 0; made < engines; made++) {
        require_ok(esl_engine_new(NULL, &engine, &failure), failure);
        esl_engine_free(engine);
    }
    printf("%.1f\n", (now() - start) / (double)engines);
    return 0;
}
