/* The reaction of a thread: see reaction.esl. Threads of normal priority make the load. Nothing compiles, and a
 * waiting task is nothing to the system. With `send` it is the peer of all the programs, which sends the time of day
 * every millisecond.
 *
 *     reaction timer|input idle|compute|allocate SAMPLES [PORT]
 *     reaction send PORT
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

static int64_t read_clock(clockid_t clock) {
    struct timespec time;
    clock_gettime(clock, &time);
    return time.tv_sec * 1000000000LL + time.tv_nsec;
}

static void sleep_until(int64_t time) {
    struct timespec until = {time / 1000000000, time % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) != 0) {}
}

static int fibonacci(int n) { return n < 2 ? n : fibonacci(n - 1) + fibonacci(n - 2); }

/* A tenth of the time. */
static void *compute(void *unused) {
    (void)unused;
    for (volatile int sum = 0;;) {
        for (int64_t end = read_clock(CLOCK_MONOTONIC) + 4000000; read_clock(CLOCK_MONOTONIC) < end;) sum += fibonacci(15);
        sleep_until(read_clock(CLOCK_MONOTONIC) + 46000000);
    }
    return NULL;
}

struct cell {
    void *first;
    struct cell *rest;
};

static struct cell *list(int length) {
    struct cell *all = NULL;
    for (int i = 0; i < length; i++) {
        struct cell *cell = malloc(sizeof(struct cell));
        *cell = (struct cell){NULL, all};
        all = cell;
    }
    return all;
}

static struct cell *live[1000];

static void *allocate(void *unused) {
    (void)unused;
    for (int i = 0; i < 1000; i++) live[i] = list(6250);
    int64_t begin = read_clock(CLOCK_MONOTONIC), bytes = 0;
    for (;;) {
        for (int i = 0; i < 64; i++) {
            for (struct cell *all = list(1000), *rest; all; all = rest) {
                rest = all->rest;
                free(all);
            }
        }
        bytes += 1024000;
        if (bytes > read_clock(CLOCK_MONOTONIC) - begin + 1000000) sleep_until(begin + bytes);
    }
    return NULL;
}

static void begin(void *(*function)(void *)) {
    pthread_t thread;
    pthread_attr_t attributes;
    struct sched_param none = {0};
    pthread_attr_init(&attributes);
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    pthread_attr_setschedparam(&attributes, &none);
    if (pthread_create(&thread, &attributes, function, NULL)) abort();
}

static struct sockaddr_in at(int port) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

static void send_for_ever(int port) {
    int out = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in peer = at(port);
    for (int64_t next = read_clock(CLOCK_MONOTONIC);; next += 1000000) {
        char text[32];
        sleep_until(next);
        int length = snprintf(text, sizeof text, "%lld", (long long)read_clock(CLOCK_REALTIME));
        sendto(out, text, length, 0, (struct sockaddr *)&peer, sizeof peer);
    }
}

int main(int count, char **arguments) {
    if (count == 3 && !strcmp(arguments[1], "send")) send_for_ever(atoi(arguments[2]));
    if (count < 4) return 2;
    int samples = atoi(arguments[3]);
    int64_t *delays = calloc(samples, sizeof *delays);
    mlockall(MCL_CURRENT);
    if (!strcmp(arguments[2], "compute"))
        for (int i = 0; i < 10; i++) begin(compute);
    if (!strcmp(arguments[2], "allocate")) begin(allocate);
    sleep(2);
    if (!strcmp(arguments[1], "timer")) {
        int64_t next = read_clock(CLOCK_MONOTONIC) + 100000000;
        for (int i = 0; i < samples; i++) {
            sleep_until(next);
            delays[i] = read_clock(CLOCK_MONOTONIC) - next;
            next += 1000000 * (1 + delays[i] / 1000000);
        }
    } else {
        int in = socket(AF_INET, SOCK_DGRAM, 0);
        struct sockaddr_in here = at(atoi(arguments[4]));
        if (bind(in, (struct sockaddr *)&here, sizeof here)) return 1;
        for (int i = 0; i < samples; i++) {
            char text[32] = {0};
            if (recv(in, text, sizeof text - 1, 0) < 0) return 1;
            delays[i] = read_clock(CLOCK_REALTIME) - atoll(text);
        }
    }
    for (int i = 0; i < samples; i++) printf("%lld\n", (long long)delays[i]);
    return 0;
}
