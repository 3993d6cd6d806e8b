/* The commands `eslvm` and `eslc` of the wheel: this program opens the extension module of the package, which
 * contains them, and calls its function `esl_command`. So a wheel has the machine once, and a command starts
 * without Python.
 *
 * The program looks for the module where pip installs it beside this file, and asks Python if it is not there.
 *
 * The module refers to functions and variables of Python, which commands do not use. `packaging/build` generates
 * definitions of these names, which it compiles with this file, and defines VERSION. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <glob.h>
#include <limits.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MODULE "esl/_esl.abi3.so"
#define METADATA "esl_lang-" VERSION ".dist-info"

/* Places of packages, seen from the folder of this file. */
static const char *const places[] = {
    "../lib/python3*/site-packages", "../lib64/python3*/site-packages", "../lib/python3*/dist-packages",
    "../lib/python3/dist-packages",  "../local/lib/python3*/dist-packages", "..",
};

/* Prepares the streams as a program in Rust does: a write to a closed stream or pipe is an error. */
static void prepare(void) {
    signal(SIGPIPE, SIG_IGN);
    for (int stream = 0; stream < 3; stream++)
        if (fcntl(stream, F_GETFD) == -1 && open("/dev/null", O_RDWR) == -1) abort();
}

/* Runs the command, if the module is in this folder. The folder of another version is left out if `exact`. */
static void start_from(const char *folder, bool exact) {
    char path[PATH_MAX];
    if (exact) {
        snprintf(path, sizeof path, "%s/%s", folder, METADATA);
        if (access(path, F_OK)) return;
    }
    snprintf(path, sizeof path, "%s/%s", folder, MODULE);
    if (access(path, R_OK)) return;
    void *module = dlopen(path, RTLD_NOW);
    void (*command)(void) = module ? (void (*)(void))dlsym(module, "esl_command") : NULL;
    if (!command) {
        fprintf(stderr, "eslvm: %s\n", dlerror());
        exit(2);
    }
    prepare();
    command();
}

static void start_beside(const char *own, bool exact) {
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        char pattern[PATH_MAX];
        glob_t found;
        if (snprintf(pattern, sizeof pattern, "%s/%s", own, places[i]) >= (int)sizeof pattern) continue;
        if (glob(pattern, 0, NULL, &found)) continue;
        for (size_t j = 0; j < found.gl_pathc; j++) start_from(found.gl_pathv[j], exact);
        globfree(&found);
    }
}

/* Asks a Python where the package is. */
static void start_by(const char *python) {
    char command[PATH_MAX + 200], folder[PATH_MAX];
    const char *text = "import importlib.util as u, os; s = u.find_spec(\"esl\"); "
                       "print(os.path.dirname(s.submodule_search_locations[0]) if s else \"\")";
    if (snprintf(command, sizeof command, "'%s' -c '%s' 2>/dev/null", python, text) >= (int)sizeof command) return;
    FILE *answer = popen(command, "r");
    if (!answer) return;
    bool is_there = fgets(folder, sizeof folder, answer) != NULL;
    pclose(answer);
    if (!is_there) return;
    folder[strcspn(folder, "\n")] = 0;
    if (*folder) start_from(folder, false);
}

int main(void) {
    char own[PATH_MAX], python[PATH_MAX];
    ssize_t length = readlink("/proc/self/exe", own, sizeof own - 1);
    if (length > 0) {
        own[length] = 0;
        *strrchr(own, '/') = 0;
        start_beside(own, true);
        start_beside(own, false);
        if (snprintf(python, sizeof python, "%s/python3", own) < (int)sizeof python && !access(python, X_OK))
            start_by(python);
    }
    start_by("python3");
    fprintf(stderr, "eslvm: the package esl-lang is neither beside this file nor known to python3: install it by "
                    "`python3 -m pip install esl-lang`\n");
    return 2;
}
