/* The C API of ESL, the Execution Support Language. */

#ifndef ESL_H
#define ESL_H

/* Written by cbindgen from capi/src: ESL_BLESS=1 cargo test -p esl-capi. */

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/**
 * A value from a program, or for one: numbers, texts, symbols, lists, vectors.
 *
 * A value that a function returns as `esl_value *` belongs to the caller, who frees it; one that comes as
 * `const esl_value *` is a part of something else and lives as long as that. Values are never changed, and
 * may be read from several threads at a time.
 */
typedef struct esl_value esl_value;


/**
 * The outcome of a call. All but `ESL_OK` and `ESL_PENDING` come with a failure, if the caller asks for one.
 */
typedef enum {
  /**
   * The call has done what it says.
   */
  ESL_OK = 0,
  /**
   * The answer has not come yet.
   */
  ESL_PENDING = 1,
  /**
   * A failure of the program has left the evaluation; it has a cause, arguments and frames.
   */
  ESL_FAILED = 2,
  /**
   * A text cannot be read or compiled. The message has its errors.
   */
  ESL_DOES_NOT_COMPILE = 3,
  /**
   * The evaluation was aborted.
   */
  ESL_ABORTED = 4,
  /**
   * The evaluation waits for an event that no task can signal.
   */
  ESL_DEADLOCKED = 5,
  /**
   * The budget or the ticks of an evaluation are spent.
   */
  ESL_BUDGET_SPENT = 6,
  /**
   * The run was stopped by `esl_handle_stop`.
   */
  ESL_STOPPED = 7,
  /**
   * The limit of memory leaves no room.
   */
  ESL_NO_MEMORY = 8,
  /**
   * A value is not of the type that was asked for, or cannot leave the program.
   */
  ESL_NOT_OF_TYPE = 9,
  /**
   * A file cannot be read, or a compiled one is damaged.
   */
  ESL_UNREADABLE = 10,
  /**
   * An argument is null, is not UTF-8, was freed before, or names nothing.
   */
  ESL_INVALID_ARGUMENT = 11,
  /**
   * The engine is in a call, of another thread or of the caller's own.
   */
  ESL_BUSY = 12,
  /**
   * An input is full, and its rule is that senders wait.
   */
  ESL_FULL = 13,
  /**
   * The engine is gone, or replays a run without this question.
   */
  ESL_ENDED = 14,
  /**
   * The program has asked to end; the argument of the failure is the status.
   */
  ESL_PROGRAM_EXITED = 16,
  /**
   * The engine replays a recording, and does something else than the recorded engine did. The message says
   * what.
   */
  ESL_DIVERGED = 17,
  /**
   * The folder of a durable run is in use, damaged, cannot be written, or has the run of another program.
   * The message says what to do.
   */
  ESL_NOT_DURABLE = 18,
  /**
   * A fault of ESL itself. The message has what to report.
   */
  ESL_PANIC = 15,
} esl_status;

/**
 * The effect of making a call of a function twice. It decides about a call that the end of a process has
 * interrupted.
 */
typedef enum {
  /**
   * It may not be made twice: the call fails with `:INTERRUPTED-BY-RESTART`, unless its operation has
   * saved a state.
   */
  ESL_ONCE = 0,
  /**
   * It only reads, or the second time changes nothing: the next process makes the call again.
   */
  ESL_IDEMPOTENT = 1,
} esl_effect;

/**
 * Where a run stands.
 */
typedef enum {
  /**
   * Some task can go on at once.
   */
  ESL_RUNNING = 0,
  /**
   * All tasks wait.
   */
  ESL_WAITING = 1,
  /**
   * Every task has ended.
   */
  ESL_DONE = 2,
  /**
   * The program has asked to end, with a status.
   */
  ESL_EXITED = 3,
  /**
   * The tasks that are left wait for what cannot come.
   */
  ESL_STUCK = 4,
  /**
   * The budget of the run is spent.
   */
  ESL_SPENT = 5,
  /**
   * `esl_handle_stop` has ended the run for now.
   */
  ESL_HALTED = 6,
} esl_state;

/**
 * Kind of an event of a run.
 */
typedef enum {
  /**
   * The task was made, or was there when the observer came; the text is its name.
   */
  ESL_TASK_BEGINS = 0,
  /**
   * Reports call the task by another name from now on.
   */
  ESL_TASK_IS_NAMED = 1,
  /**
   * The task's turn begins.
   */
  ESL_TASK_RUNS = 2,
  /**
   * It could run, but another one does.
   */
  ESL_TASK_IS_READY = 3,
  /**
   * It waits, for what the text says.
   */
  ESL_TASK_WAITS = 4,
  /**
   * It is suspended by the task that the text names.
   */
  ESL_TASK_IS_SUSPENDED = 5,
  /**
   * It is to be aborted.
   */
  ESL_TASK_IS_TO_END = 6,
  /**
   * It has ended, as the text says: succeeded, failed or aborted.
   */
  ESL_TASK_ENDS = 7,
  /**
   * It has signalled the event of this name.
   */
  ESL_TASK_SIGNALS = 8,
  /**
   * A signal of the other task, or of none, has ended its wait; the text names the event.
   */
  ESL_TASK_IS_WOKEN = 9,
  /**
   * It fails, with this cause.
   */
  ESL_TASK_FAILS = 10,
  /**
   * A recovery procedure begins to deal with a failure of this cause.
   */
  ESL_TASK_RECOVERS = 11,
  /**
   * The fact of the text was asserted.
   */
  ESL_FACT_ASSERTED = 12,
  /**
   * The fact of the text was retracted.
   */
  ESL_FACT_RETRACTED = 13,
  /**
   * The collector begins a cycle. The task is 0, as for all that the collector does.
   */
  ESL_COLLECTION_BEGINS = 14,
  /**
   * The collector begins a turn, in which no task runs.
   */
  ESL_PAUSE_BEGINS = 15,
  /**
   * The collector's turn is over.
   */
  ESL_PAUSE_ENDS = 16,
  /**
   * The collector has ended a cycle.
   */
  ESL_COLLECTION_ENDS = 17,
} esl_event;

/**
 * Kinds of values.
 */
typedef enum {
  /**
   * `NIL`: false, and the empty list.
   */
  ESL_NIL = 0,
  /**
   * `T`: true.
   */
  ESL_TRUE = 1,
  /**
   * An integer of 64 bits.
   */
  ESL_INTEGER = 2,
  /**
   * A larger integer; `esl_value_print` writes it.
   */
  ESL_BIG_INTEGER = 3,
  /**
   * A ratio; `esl_value_print` writes it.
   */
  ESL_RATIO = 4,
  /**
   * A double float.
   */
  ESL_FLOAT = 5,
  /**
   * A character; its text is that character.
   */
  ESL_CHARACTER = 6,
  /**
   * A string.
   */
  ESL_STRING = 7,
  /**
   * A keyword; its text is its name.
   */
  ESL_KEYWORD = 8,
  /**
   * Another symbol; its text is its name.
   */
  ESL_SYMBOL = 9,
  /**
   * A proper list, not empty.
   */
  ESL_LIST = 10,
  /**
   * A list whose last `cdr` is not `NIL`, which is its last item here.
   */
  ESL_DOTTED_LIST = 11,
  /**
   * A vector.
   */
  ESL_VECTOR = 12,
  /**
   * A vector of bytes.
   */
  ESL_BYTES = 13,
  /**
   * A vector of integers of 64 bits.
   */
  ESL_INTEGERS = 14,
  /**
   * A vector of double floats.
   */
  ESL_FLOATS = 15,
  /**
   * An object of the embedder's.
   */
  ESL_HOST_OBJECT = 16,
  /**
   * A hash table that compares its keys by `eq`, `eql` or `equal`; its items are its keys, each followed
   * by its value.
   */
  ESL_TABLE = 17,
} esl_kind;

/**
 * Settings for engines: limits, rights, clock. A new one has the defaults: a gigabyte of memory, no rights,
 * real time. One thread at a time.
 */
typedef struct esl_config esl_config;

/**
 * A durable run: a program whose state is kept in a folder. It is made, given its functions, opened with its
 * program, and run; all of that in the same way in each process. From all threads.
 */
typedef struct esl_durable esl_durable;

/**
 * A machine in which programs run. It serves one thread at a time; a call while another one is under way
 * returns `ESL_BUSY`. Other threads reach the run by handles.
 */
typedef struct esl_engine esl_engine;

/**
 * Why a call has not done what it says.
 *
 * A failure belongs to its caller, who frees it. Texts and values that are read from it live as long as it.
 * From any thread, one at a time.
 */
typedef struct esl_failure esl_failure;

/**
 * A way into a run, from all threads at the same time. While a program has a handle, it waits for what may
 * come by it instead of being deadlocked.
 */
typedef struct esl_handle esl_handle;

/**
 * Work that C does for a task of the program, which waits for its end. It belongs to C, which ends it once,
 * by `esl_operation_complete` or `esl_operation_fail`, on any thread and at any time, also when the engine
 * is gone. Until then it may be used from one thread at a time.
 */
typedef struct esl_operation esl_operation;

/**
 * Everything that a run has learnt from outside: the answers of its host, the messages of handles, and the
 * results of functions and operations. It belongs to the caller, who frees it. From any thread.
 */
typedef struct esl_recording esl_recording;

/**
 * An answer to come from a run. It belongs to the caller, who frees it, which changes nothing in the run.
 * From any thread, one at a time.
 */
typedef struct esl_reply esl_reply;

/**
 * A task that was started by a handle.
 */
typedef struct esl_task esl_task;

/**
 * A watch, over facts or over all events of a run. It belongs to the caller, and lasts until it is freed.
 * From any thread, one at a time.
 */
typedef struct esl_watch esl_watch;

/**
 * A function that takes the output of programs. It is called on the threads of engines, with `length` bytes
 * that live until it returns; they are UTF-8, but may begin or end within a character.
 */
typedef void (*esl_output)(void *user, const char *bytes, size_t length);

/**
 * A function that frees what `user` points to: once, on any thread, when ESL does not need it any more.
 */
typedef void (*esl_destructor)(void *user);

/**
 * A function that programs call. It gets the arguments in the order of the lambda list's variables, those
 * left out as the lambda list says; they live until it returns. It stores its value in `*result`, which the
 * engine frees, or leaves it null for `NIL`, and returns null; or it returns a failure, which the engine
 * frees, and the call fails so.
 *
 * It is called on the thread of the engine, while no task runs: it returns soon, and neither uses the engine
 * nor waits for a reply. It must not leave by an exception of C++ or by `longjmp`.
 */
typedef esl_failure *(*esl_function)(void *user,
                                     const esl_value *const *arguments,
                                     size_t count,
                                     esl_value **result);

/**
 * A function that begins an operation, which it hands to a thread or a queue. It is called on the thread of
 * the engine, and does not wait.
 */
typedef void (*esl_operation_function)(void *user, esl_operation *operation);

/**
 * The end of a durable run in this process.
 */
typedef struct {
  /**
   * Whether it was paused: the next process goes on.
   */
  bool is_paused;
  /**
   * The exit status of a run that has ended, now or in an earlier process.
   */
  uint8_t exit_status;
} esl_durable_ending;

/**
 * Where a run stands after a portion of it.
 */
typedef struct {
  /**
   * The state.
   */
  esl_state state;
  /**
   * For `ESL_EXITED` the status with which the program has asked to end.
   */
  uint8_t exit_status;
  /**
   * For `ESL_WAITING` the nanoseconds until the first task goes on; -1 if none waits for a time.
   */
  int64_t wait;
} esl_progress;

/**
 * A call that a failure has left unfinished.
 */
typedef struct {
  /**
   * Name of the function, as the program prints it.
   */
  const char *function;
  /**
   * Name of the task.
   */
  const char *task;
  /**
   * Name of the source; empty if it is not known.
   */
  const char *source;
  /**
   * Line, from 1; 0 if it is not known.
   */
  uint32_t line;
  /**
   * Column in characters, from 1; 0 if it is not known.
   */
  uint32_t column;
  /**
   * Whether the function belongs to the library, or to a module that comes with the machine.
   */
  bool is_of_library;
} esl_frame;

/**
 * An event of a run. The text lives until the observer returns; it is empty where the event has none.
 */
typedef struct {
  /**
   * The event.
   */
  esl_event event;
  /**
   * Nanoseconds since the first observer came.
   */
  uint64_t time;
  /**
   * Number of the task; 0 if there is none.
   */
  uint64_t task;
  /**
   * Number of another task that is involved; 0 if there is none.
   */
  uint64_t other_task;
  /**
   * Whether the task, where it begins, belongs to the library.
   */
  bool is_hidden;
  /**
   * The text.
   */
  const char *text;
} esl_seen;

/**
 * A function that is told what happens in a run. It is called on the thread of the engine, at each event: it
 * returns soon, and uses handles only. It must not leave by an exception of C++ or by `longjmp`.
 */
typedef void (*esl_observer)(void *user, const esl_seen *seen);

/**
 * A function that is told something about an operation or a reply. It is called on the thread of the engine,
 * and only hands on the message. It neither ends the operation nor uses the engine.
 */
typedef void (*esl_notice_function)(void *user);

/**
 * A function that is told of a change of a fact: whether the fact is in the database now, the fact, and the
 * values of the pattern's variables in it, a property list such as (:ROBOT ROVER :PLACE RIDGE). Both live
 * until it returns. It is called on the thread of the engine, while no task runs: it returns soon, and uses
 * handles only. It must not leave by an exception of C++ or by `longjmp`.
 */
typedef void (*esl_fact_function)(void *user, bool is_there, const esl_value *fact, const esl_value *bindings);

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Creates settings with the defaults.
 */
esl_config *esl_config_new(void);

/**
 * Frees settings; null is ignored. Engines that were made with them keep theirs.
 *
 * The caller sees to it that
 * `config` was not freed before.
 */
void esl_config_free(esl_config *config);

/**
 * Limits the memory of a program, in bytes.
 *
 * The caller sees to it that
 * `config` is settings, or null.
 */
esl_status esl_config_set_memory(const esl_config *config, size_t bytes);

/**
 * Limits the ticks (calls and turns of loops) of the whole run.
 *
 * The caller sees to it that
 * `config` is settings, or null.
 */
esl_status esl_config_set_budget(const esl_config *config, uint64_t ticks);

/**
 * Limits the ticks of each evaluation.
 *
 * The caller sees to it that
 * `config` is settings, or null.
 */
esl_status esl_config_set_ticks(const esl_config *config, uint64_t ticks);

/**
 * Sets the seed of all random choices.
 *
 * The caller sees to it that
 * `config` is settings, or null.
 */
esl_status esl_config_set_seed(const esl_config *config, uint64_t seed);

/**
 * Makes time virtual, so that it passes only while all tasks wait; or real.
 *
 * The caller sees to it that
 * `config` is settings, or null.
 */
esl_status esl_config_set_virtual_time(const esl_config *config, bool is_virtual);

/**
 * Has a function take what programs write, to standard output as well as to standard error, in place of the
 * streams of the process. `user` is freed when neither the settings nor an engine needs it any more; with a
 * status other than `ESL_OK` at once.
 *
 * The caller sees to it that
 * `config` is settings; `output` and `destructor` can be called with `user` on the threads of all engines
 * that are made with the settings; `failure` is a place that can be written, or null.
 */
esl_status esl_config_set_output(const esl_config *config,
                                 esl_output output,
                                 void *user,
                                 esl_destructor destructor,
                                 esl_failure **failure);

/**
 * Grants a right, as the options `--allow-…` of the commands do: "net=127.0.0.1:1883" grants access to that
 * address, "read" to all files. The rights are read, write, net, run, env, serial and fleet.
 *
 * The caller sees to it that
 * `config` is settings; `right` is a text with a null character at its end; `failure` is a place that can be
 * written, or null.
 */
esl_status esl_config_allow(const esl_config *config, const char *right, esl_failure **failure);

/**
 * Creates a durable run whose state is in a folder, which is made if there is none. `config` may be null;
 * one that records or replays is refused, since a durable run keeps a journal of its own. Limits and seed
 * are the same in each process.
 *
 * The caller sees to it that
 * `folder` ends with a null character; `config` is settings, or null; `durable` and `failure` are places
 * that can be written, or null.
 */
esl_status esl_durable_new(const char *folder,
                           const esl_config *config,
                           esl_durable **durable,
                           esl_failure **failure);

/**
 * Frees a durable run; null is ignored. One that was not run to its end goes on in the next process. Returns
 * `ESL_BUSY`, and frees nothing, while a thread runs it.
 *
 * The caller sees to it that
 * `durable` was not freed before.
 */
esl_status esl_durable_free(esl_durable *durable);

/**
 * Gives a durable run a function of C before it is opened, as `esl_define` gives one to an engine: the same
 * ones in each process.
 *
 * The caller sees to it that
 * `durable` is a durable run; the texts end with null characters; `function` and `destructor` can be called
 * with `user` on the thread that runs it; `failure` is a place that can be written, or null.
 */
esl_status esl_durable_define(const esl_durable *durable,
                              const char *name,
                              const char *lambda_list,
                              const char *documentation,
                              esl_effect effect,
                              esl_function function,
                              void *user,
                              esl_destructor destructor,
                              esl_failure **failure);

/**
 * Gives a durable run a function whose calls are operations, as `esl_durable_define` gives functions. An
 * operation that the end of a process has interrupted is begun again if it has saved a state
 * (`esl_operation_save`), or if its effect is `ESL_IDEMPOTENT`.
 *
 * The caller sees to it that
 * As for `esl_durable_define`.
 */
esl_status esl_durable_define_operation(const esl_durable *durable,
                                        const char *name,
                                        const char *lambda_list,
                                        const char *documentation,
                                        esl_effect effect,
                                        esl_operation_function begin,
                                        void *user,
                                        esl_destructor destructor,
                                        esl_failure **failure);

/**
 * Opens a durable run with its program, a text: begins it, or goes on where an earlier process was. Nothing
 * runs yet. `name` is that of the text in reports. A folder that another process has, that is damaged, or
 * that has the run of another program is refused with `ESL_NOT_DURABLE`; the message says what to do.
 *
 * The caller sees to it that
 * `durable` is a durable run; the texts end with null characters; `failure` is a place that can be written,
 * or null.
 */
esl_status esl_durable_open(const esl_durable *durable,
                            const char *name,
                            const char *text,
                            esl_failure **failure);

/**
 * As `esl_durable_open`, with the program in a source file. `require` finds modules beside it.
 *
 * The caller sees to it that
 * As for `esl_durable_open`.
 */
esl_status esl_durable_load(const esl_durable *durable, const char *path, esl_failure **failure);

/**
 * Creates a handle of a durable run that is open and does not run yet. While a program has a handle, it
 * waits for messages by it, which are in the journal before an effect depends on them.
 *
 * The caller sees to it that
 * `durable` is a durable run; `handle` and `failure` are places that can be written, or null.
 */
esl_status esl_durable_handle(const esl_durable *durable, esl_handle **handle, esl_failure **failure);

/**
 * Runs a durable run that is open until it ends or is paused. Waits while all tasks wait. The functions of
 * the program are called on this thread.
 *
 * The caller sees to it that
 * `durable` is a durable run; `ending` and `failure` are places that can be written, or null.
 */
esl_status esl_durable_run(const esl_durable *durable, esl_durable_ending *ending, esl_failure **failure);

/**
 * Has `esl_durable_run` leave the run, so that it goes on in the next process. From any thread.
 *
 * The caller sees to it that
 * `durable` is a durable run; `failure` is a place that can be written, or null.
 */
esl_status esl_durable_pause(const esl_durable *durable, esl_failure **failure);

/**
 * Returns the number of the process in which the run goes on, from 2; 0 while it has not gone on: it began
 * in this process, or repeats its journal. Stores the seconds since the last record of the one before.
 *
 * The caller sees to it that
 * `durable` is a durable run; `downtime` is a place that can be written, or null.
 */
uint64_t esl_durable_resumed(const esl_durable *durable, double *downtime);

/**
 * Has the run survive loss of power too: it waits for the disk before each effect.
 *
 * The caller sees to it that
 * `durable` is a durable run that is not open; `failure` is a place that can be written, or null.
 */
esl_status esl_durable_set_power(const esl_durable *durable,
                                 bool survives_loss_of_power,
                                 esl_failure **failure);

/**
 * Has the program's clock stand still between two processes, or count that time, which is the default. A
 * virtual clock stands still.
 *
 * The caller sees to it that
 * As for `esl_durable_set_power`.
 */
esl_status esl_durable_set_downtime(const esl_durable *durable, bool counts, esl_failure **failure);

/**
 * Says when snapshots are taken, as `--snapshot-every` does: "60s", "64M" or "never".
 *
 * The caller sees to it that
 * As for `esl_durable_set_power`; `when` ends with a null character.
 */
esl_status esl_durable_set_snapshots(const esl_durable *durable, const char *when, esl_failure **failure);

/**
 * Has a run of another version of the machine begin anew, with its facts and the variables of `defdurable`,
 * as `--from-facts` does. A run of this version goes on.
 *
 * The caller sees to it that
 * As for `esl_durable_set_power`.
 */
esl_status esl_durable_set_from_facts(const esl_durable *durable, bool from_facts, esl_failure **failure);

/**
 * Has a run whose program has changed make the new definitions before it goes on, as `--upgrade` does.
 *
 * The caller sees to it that
 * As for `esl_durable_set_power`.
 */
esl_status esl_durable_set_upgrade(const esl_durable *durable, bool upgrades, esl_failure **failure);

/**
 * Creates an engine with the library of ESL. `config` may be null, for the defaults.
 *
 * The caller sees to it that
 * `config` is settings, or null; `engine` and `failure` are places that can be written, or null.
 */
esl_status esl_engine_new(const esl_config *config, esl_engine **engine, esl_failure **failure);

/**
 * Ends what still runs in an engine, as `esl_engine_end`, and frees it. Null is ignored. Returns `ESL_BUSY`,
 * and frees nothing, while the engine is in a call. In a child of the process that has made it, ends
 * nothing.
 *
 * The caller sees to it that
 * `engine` was not freed before.
 */
esl_status esl_engine_free(esl_engine *engine);

/**
 * Ends what still runs: aborts all tasks, newest first, and runs their cleanups; cancels operations under
 * way, and waits until they have stopped.
 *
 * The caller sees to it that
 * `engine` is an engine; `failure` is a place that can be written, or null.
 */
esl_status esl_engine_end(const esl_engine *engine, esl_failure **failure);

/**
 * Evaluates the forms of a text one after another, and stores the first value of the last form.
 *
 * The caller sees to it that
 * `engine` is an engine; `text` ends with a null character; `value` and `failure` are places that can be
 * written, or null.
 */
esl_status esl_eval(const esl_engine *engine, const char *text, esl_value **value, esl_failure **failure);

/**
 * Evaluates the forms of a source file, or runs a compiled file (`.eslb`), and stores the first value of the
 * last form. The program needs no right for it. `require` finds modules beside the file if the program may
 * read them.
 *
 * The caller sees to it that
 * As for `esl_eval`.
 */
esl_status esl_load(const esl_engine *engine, const char *path, esl_value **value, esl_failure **failure);

/**
 * Calls a function of the program, by its name in any case, with `count` arguments, which are copied. Stores
 * its first value.
 *
 * The caller sees to it that
 * `engine` is an engine; `function` ends with a null character; `arguments` points to `count` values;
 * `value` and `failure` are places that can be written, or null.
 */
esl_status esl_call(const esl_engine *engine,
                    const char *function,
                    const esl_value *const *arguments,
                    size_t count,
                    esl_value **value,
                    esl_failure **failure);

/**
 * Has a text evaluated as a task of the runs to come; runs nothing. `reply` gets what will become of it.
 *
 * The caller sees to it that
 * `engine` is an engine; `text` ends with a null character; `reply` and `failure` are places that can be
 * written, or null.
 */
esl_status esl_begin(const esl_engine *engine, const char *text, esl_reply **reply, esl_failure **failure);

/**
 * Runs tasks until all have ended or wait for what cannot come. Waits while all of them wait.
 *
 * The caller sees to it that
 * `engine` is an engine; `progress` and `failure` are places that can be written, or null.
 */
esl_status esl_run(const esl_engine *engine, esl_progress *progress, esl_failure **failure);

/**
 * Runs tasks for a number of ticks, for a loop of the caller's; never waits. When all tasks wait, the caller
 * waits for the time that `progress` names, and for the file descriptor of `esl_wakeup_fd`.
 *
 * The caller sees to it that
 * As for `esl_run`.
 */
esl_status esl_poll(const esl_engine *engine, uint64_t ticks, esl_progress *progress, esl_failure **failure);

/**
 * Stores a file descriptor that becomes readable when something has come for the engine, so that a loop
 * waits for it by `poll`, `epoll` or the like, and calls `esl_poll` then. It belongs to the engine: the
 * caller neither reads nor closes it.
 *
 * The caller sees to it that
 * `engine` is an engine; `descriptor` and `failure` are places that can be written, or null.
 */
esl_status esl_wakeup_fd(const esl_engine *engine, int *descriptor, esl_failure **failure);

/**
 * Creates a failure for a function or an operation of the embedder's to fail with. `cause` is the name of a
 * keyword, such as "valve-stuck"; the `count` arguments are copied. Returns null if an argument is invalid.
 * From any thread.
 *
 * The caller sees to it that
 * `cause` is a text with a null character at its end; `arguments` points to `count` values.
 */
esl_failure *esl_failure_new(const char *cause, const esl_value *const *arguments, size_t count);

/**
 * Frees a failure; a null pointer is ignored.
 *
 * The caller sees to it that
 * `failure` was not freed before.
 */
void esl_failure_free(esl_failure *failure);

/**
 * Returns the status that the call had.
 *
 * The caller sees to it that
 * `failure` is a failure, or null.
 */
esl_status esl_failure_status(const esl_failure *failure);

/**
 * Returns the cause, as the program prints it: ":VALVE-STUCK".
 *
 * The caller sees to it that
 * `failure` is a failure, or null.
 */
const char *esl_failure_cause(const esl_failure *failure);

/**
 * Returns the message, a sentence.
 *
 * The caller sees to it that
 * `failure` is a failure, or null.
 */
const char *esl_failure_message(const esl_failure *failure);

/**
 * Returns the message, the frames, and the failures that were being recovered from, as the commands print
 * them.
 *
 * The caller sees to it that
 * `failure` is a failure, or null.
 */
const char *esl_failure_report(const esl_failure *failure);

/**
 * Returns the number of arguments.
 *
 * The caller sees to it that
 * `failure` is a failure, or null.
 */
size_t esl_failure_argument_count(const esl_failure *failure);

/**
 * Returns an argument, from 0; null beyond the last. It is a part of the failure.
 *
 * The caller sees to it that
 * `failure` is a failure, or null.
 */
const esl_value *esl_failure_argument(const esl_failure *failure, size_t index);

/**
 * Returns the number of frames.
 *
 * The caller sees to it that
 * `failure` is a failure, or null.
 */
size_t esl_failure_frame_count(const esl_failure *failure);

/**
 * Reads a frame, from 0, innermost first. The calls of a failed task of a net come before those of the task
 * with the net. Returns false beyond the last.
 *
 * The caller sees to it that
 * `failure` is a failure or null, and `frame` a place that can be written.
 */
bool esl_failure_frame(const esl_failure *failure, size_t index, esl_frame *frame);

/**
 * Defines a function that programs call and C implements. `lambda_list` is that of the function, in ESL:
 * "(metres &key (speed 0.1))". A function of this name is replaced, and its `user` freed at the end of the
 * engine at the latest. With a status other than `ESL_OK`, `user` is freed at once.
 *
 * The caller sees to it that
 * `engine` is an engine; the texts end with null characters; `function` and `destructor` can be called with
 * `user`; `failure` is a place that can be written, or null.
 */
esl_status esl_define(esl_engine *engine,
                      const char *name,
                      const char *lambda_list,
                      const char *documentation,
                      esl_function function,
                      void *user,
                      esl_destructor destructor,
                      esl_failure **failure);

/**
 * Creates a handle of an engine, on the thread that uses the engine.
 *
 * The caller sees to it that
 * `engine` is an engine; `handle` and `failure` are places that can be written, or null.
 */
esl_status esl_engine_handle(const esl_engine *engine, esl_handle **handle, esl_failure **failure);

/**
 * Creates another handle of the same engine. Returns null for null.
 *
 * The caller sees to it that
 * `handle` is a handle, or null.
 */
esl_handle *esl_handle_copy(const esl_handle *handle);

/**
 * Frees a handle; null is ignored.
 *
 * The caller sees to it that
 * `handle` was not freed before.
 */
void esl_handle_free(esl_handle *handle);

/**
 * Signals an input of the program, by its name in any case, with `count` arguments, which are copied. If the
 * input is full, and its rule is that senders wait, waits with `waits`, and otherwise returns `ESL_FULL`.
 * Not on the thread of the engine with `waits`.
 *
 * The caller sees to it that
 * `handle` is a handle; `input` ends with a null character; `arguments` points to `count` values; `failure`
 * is a place that can be written, or null.
 */
esl_status esl_handle_signal(const esl_handle *handle,
                             const char *input,
                             const esl_value *const *arguments,
                             size_t count,
                             bool waits,
                             esl_failure **failure);

/**
 * Adds a fact to the program's database. The answer is whether it is new. `reply` may be null.
 *
 * The caller sees to it that
 * `handle` is a handle and `value` a value; `reply` and `failure` are places that can be written, or null.
 */
esl_status esl_handle_assert(const esl_handle *handle,
                             const esl_value *value,
                             esl_reply **reply,
                             esl_failure **failure);

/**
 * Removes the facts that match a pattern. The answer is how many there were. `reply` may be null.
 *
 * The caller sees to it that
 * `handle` is a handle and `value` a value; `reply` and `failure` are places that can be written, or null.
 */
esl_status esl_handle_retract(const esl_handle *handle,
                              const esl_value *value,
                              esl_reply **reply,
                              esl_failure **failure);

/**
 * Asks the program's database. The query is what `db-query` takes: a pattern, such as
 * "(at ?robot ?place)", or `(and query…)` and the like. The answer is a list of property lists:
 * ((:ROBOT ROVER :PLACE RIDGE)).
 *
 * The caller sees to it that
 * `handle` is a handle and `value` a value; `reply` and `failure` are places that can be written, or null.
 */
esl_status esl_handle_query(const esl_handle *handle,
                            const esl_value *value,
                            esl_reply **reply,
                            esl_failure **failure);

/**
 * Sets a property of the program for `count` arguments. The answer is whether that has changed its value.
 *
 * The caller sees to it that
 * `handle` is a handle; `property` ends with a null character; `arguments` points to `count` values; `value`
 * is a value; `reply` and `failure` are places that can be written, or null.
 */
esl_status esl_handle_set(const esl_handle *handle,
                          const char *property,
                          const esl_value *const *arguments,
                          size_t count,
                          const esl_value *value,
                          esl_reply **reply,
                          esl_failure **failure);

/**
 * Calls a function of the program, by its name in any case, in a task of its own. The answer is its first
 * value.
 *
 * The caller sees to it that
 * `handle` is a handle; `function` ends with a null character; `arguments` points to `count` values; `reply`
 * and `failure` are places that can be written, or null.
 */
esl_status esl_handle_call(const esl_handle *handle,
                           const char *function,
                           const esl_value *const *arguments,
                           size_t count,
                           esl_reply **reply,
                           esl_failure **failure);

/**
 * Starts a task that calls a function of the program, by its name in any case.
 *
 * The caller sees to it that
 * As for `esl_handle_call`; `task` is a place that can be written, or null.
 */
esl_status esl_handle_spawn(const esl_handle *handle,
                            const char *function,
                            const esl_value *const *arguments,
                            size_t count,
                            esl_task **task,
                            esl_failure **failure);

/**
 * Aborts a task: it unwinds and runs its cleanups. Nothing happens if it has ended. From any thread.
 *
 * The caller sees to it that
 * `task` is a task.
 */
esl_status esl_task_abort(const esl_task *task);

/**
 * Returns the reply of a task, which is freed: the first value of its function. Returns null for null.
 *
 * The caller sees to it that
 * `task` is a task that was not freed before, or null.
 */
esl_reply *esl_task_into_reply(esl_task *task);

/**
 * Frees a task, which goes on; null is ignored.
 *
 * The caller sees to it that
 * `task` was not freed before.
 */
void esl_task_free(esl_task *task);

/**
 * Asks for the tasks that have not ended, in the order in which they were made. The answer is a list of
 * property lists: ((:NUMBER 3 :MAKER 0 :NAME "PATROL-1" :WAITS-FOR "the timer" :TICKS 120)), where the maker
 * is 0 for a task that the embedder has made, and `:WAITS-FOR` is `NIL` for one that can run.
 *
 * The caller sees to it that
 * `handle` is a handle; `reply` and `failure` are places that can be written, or null.
 */
esl_status esl_handle_tasks(const esl_handle *handle, esl_reply **reply, esl_failure **failure);

/**
 * Aborts the task with this number, which `esl_handle_tasks` and observers tell. Nothing happens if it has
 * ended.
 *
 * The caller sees to it that
 * `handle` is a handle.
 */
esl_status esl_handle_abort(const esl_handle *handle, uint64_t task);

/**
 * Has no task run, until `esl_handle_resume` or the end of the last handle. The clock goes on, if it is
 * not virtual.
 *
 * The caller sees to it that
 * `handle` is a handle.
 */
esl_status esl_handle_pause(const esl_handle *handle);

/**
 * Has tasks run again.
 *
 * The caller sees to it that
 * `handle` is a handle.
 */
esl_status esl_handle_resume(const esl_handle *handle);

/**
 * Has an evaluation or a run of the engine end with `ESL_STOPPED`. Tasks go on in the next run.
 *
 * The caller sees to it that
 * `handle` is a handle.
 */
esl_status esl_handle_stop(const esl_handle *handle);

/**
 * Has the program end as if the process had got SIGTERM: tasks unwind and run their cleanups, unless the
 * program handles the signal.
 *
 * The caller sees to it that
 * `handle` is a handle.
 */
esl_status esl_handle_terminate(const esl_handle *handle);

/**
 * Reads a value from a text in JSON: objects are association lists whose keys are strings, arrays vectors,
 * true and false `T` and `NIL`, null `:NULL`, integers of up to 64 bits integers, other numbers floats. An
 * empty object is `NIL`. From any thread.
 *
 * The caller sees to it that
 * `json` is a text with a null character at its end; `value` and `failure` are places that can be written,
 * or null.
 */
esl_status esl_value_of_json(const char *json, esl_value **value, esl_failure **failure);

/**
 * Writes a value as a text in JSON, for `esl_text_free`. A list is an object if all its items are pairs
 * whose keys are strings, symbols or integers, otherwise an array. `NIL` is false, `:NULL` null; other
 * symbols are strings in lower case. A value without a form in JSON, such as an infinite float or an object
 * of the embedder's, is refused with `ESL_NOT_OF_TYPE`.
 *
 * The caller sees to it that
 * `value` is a value; `json` and `failure` are places that can be written, or null.
 */
esl_status esl_value_json(const esl_value *value, char **json, esl_failure **failure);

/**
 * Creates a value for an object of the embedder's, such as an open device, which programs hold, hand on and
 * compare by `eq`. They print it as `#<TYPE LABEL>`. `destructor` is called with the pointer, once and on
 * any thread, when neither C nor a program has the value any more, or by `esl_object_close`. Returns null,
 * and calls it, if a text is invalid.
 *
 * The caller sees to it that
 * `type` and `label` are texts with null characters at their ends; `pointer` can be handed to other threads.
 */
esl_value *esl_object(const char *type, const char *label, void *pointer, esl_destructor destructor);

/**
 * Returns the pointer of an object of this type. It is valid until the value is freed, if nothing else
 * refers to the object, or until it is closed. Returns null for other values, and for an object that was
 * closed.
 *
 * The caller sees to it that
 * `value` is a value, or null; `type` is a text with a null character at its end, or null.
 */
void *esl_value_object(const esl_value *value, const char *type);

/**
 * Takes an object away from programs, which keep an empty one: calls the destructor now. Returns false for
 * other values, and for an object that was closed before.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
bool esl_object_close(const esl_value *value);

/**
 * Has an observer told what happens in the run, from the next turn on, until the watch is freed: `user` is
 * freed before the next event then. Where `watch` is null, until the end of the engine. With a status other
 * than `ESL_OK`, `user` is freed at once. From any thread.
 *
 * The caller sees to it that
 * `handle` is a handle; `observer` and `destructor` can be called with `user`; `watch` and `failure` are
 * places that can be written, or null.
 */
esl_status esl_handle_subscribe(const esl_handle *handle,
                                esl_observer observer,
                                void *user,
                                esl_destructor destructor,
                                esl_watch **watch,
                                esl_failure **failure);

/**
 * Defines a function whose calls are operations, as `esl_define` defines functions.
 *
 * The caller sees to it that
 * As for `esl_define`.
 */
esl_status esl_define_operation(esl_engine *engine,
                                const char *name,
                                const char *lambda_list,
                                const char *documentation,
                                esl_operation_function begin,
                                void *user,
                                esl_destructor destructor,
                                esl_failure **failure);

/**
 * Returns the number of arguments.
 *
 * The caller sees to it that
 * `operation` is an operation, or null.
 */
size_t esl_operation_argument_count(const esl_operation *operation);

/**
 * Returns an argument, from 0, in the order of the lambda list's variables; null beyond the last. It is a
 * part of the operation.
 *
 * The caller sees to it that
 * `operation` is an operation, or null.
 */
const esl_value *esl_operation_argument(const esl_operation *operation, size_t index);

/**
 * Ends an operation, which is freed: the call returns the value, or `NIL` for null. The value is copied.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended; `value` is a value, or null.
 */
esl_status esl_operation_complete(esl_operation *operation, const esl_value *value);

/**
 * Ends an operation, which is freed: the call fails with the failure, which is freed too.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended; `failure` is a failure.
 */
esl_status esl_operation_fail(esl_operation *operation, esl_failure *failure);

/**
 * Frees an operation that nobody performs: the call fails with `:OPERATION-DROPPED`, and one that was
 * cancelled has stopped. Null is ignored.
 *
 * The caller sees to it that
 * `operation` has not ended.
 */
void esl_operation_free(esl_operation *operation);

/**
 * Reports how far an operation is, for `operation-progress`. The value is copied.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended; `value` is a value.
 */
esl_status esl_operation_report_progress(const esl_operation *operation, const esl_value *value);

/**
 * Returns whether the program has left the call, or cancelled the operation.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended, or null.
 */
bool esl_operation_is_cancelled(const esl_operation *operation);

/**
 * Has `function` called when the program leaves the call, or cancels the operation; at once if it has done
 * so already. The program waits until the operation has ended or is freed, so that what is still moving is
 * not commanded again.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended; `function` and `destructor` can be called with `user` on
 * any thread.
 */
esl_status esl_operation_on_cancel(const esl_operation *operation,
                                   esl_notice_function function,
                                   void *user,
                                   esl_destructor destructor);

/**
 * Returns the identity of the call in a durable run, 32 hexadecimal digits, the same in each process that
 * performs it; null in a run that is not durable. It lives as long as the operation.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended, or null.
 */
const char *esl_operation_action(const esl_operation *operation);

/**
 * Keeps `length` bytes of C's own with the state of a durable run, in place of those that the operation has
 * saved before, and returns when they are as safe as the run demands. The next process begins an operation
 * that has saved a state again, whatever its effect is, and gets the bytes by `esl_operation_restore`.
 * Returns `ESL_NOT_DURABLE` if they cannot be kept, since the disk has failed or they are more than 64 MiB:
 * then the operation does not go on: it fails, or is freed. In a run that is not durable it has no effect.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended; `bytes` points to `length` bytes.
 */
esl_status esl_operation_save(const esl_operation *operation, const void *bytes, size_t length);

/**
 * Returns the bytes that the operation had saved last when it was begun, in an earlier process, and stores
 * their number; null if there are none. They live as long as the operation.
 *
 * The caller sees to it that
 * `operation` is an operation that has not ended; `length` is a place that can be written, or null.
 */
const void *esl_operation_restore(const esl_operation *operation, size_t *length);

/**
 * Makes the definitions of a text in the program, all at once, or none of them if any fails: calls that are
 * under way keep the code that they have. `name` stands for the text in messages. Stores the number of
 * definitions.
 *
 * The caller sees to it that
 * `engine` is an engine; `name` and `text` end with null characters; `count` and `failure` are places that
 * can be written, or null.
 */
esl_status esl_patch(const esl_engine *engine,
                     const char *name,
                     const char *text,
                     size_t *count,
                     esl_failure **failure);

/**
 * Takes the newest patch back: its names mean what they meant before. Stores the number of its definitions;
 * 0 if there is no patch.
 *
 * The caller sees to it that
 * `engine` is an engine; `count` and `failure` are places that can be written, or null.
 */
esl_status esl_undo_patch(const esl_engine *engine, size_t *count, esl_failure **failure);

/**
 * Stores the definitions of the program in a package, "esl-user" unless it says otherwise, sorted by name: a
 * list of property lists such as (:KIND :FUNCTION :NAME "DRIVE" :PARAMETERS "metres &key (speed 0.1)"
 * :DOCUMENTATION "Drives."). The kinds are function, operation, macro, property, input, variable, constant.
 *
 * The caller sees to it that
 * `engine` is an engine; `package` ends with a null character; `definitions` and `failure` are places that
 * can be written, or null.
 */
esl_status esl_definitions(const esl_engine *engine,
                           const char *package,
                           esl_value **definitions,
                           esl_failure **failure);

/**
 * Has a function called for each change of a fact that matches a pattern, such as "(at ?robot ?place)", in
 * the order of the changes, until the watch is freed. With a status other than `ESL_OK`, `user` is freed at
 * once, otherwise with the engine.
 *
 * The caller sees to it that
 * `engine` is an engine and `pattern` a value; `function` and `destructor` can be called with `user`;
 * `watch` and `failure` are places that can be written, or null.
 */
esl_status esl_watch_facts(const esl_engine *engine,
                           const esl_value *pattern,
                           esl_fact_function function,
                           void *user,
                           esl_destructor destructor,
                           esl_watch **watch,
                           esl_failure **failure);

/**
 * Ends a watch, and frees it; null is ignored.
 *
 * The caller sees to it that
 * `watch` was not freed before.
 */
void esl_watch_free(esl_watch *watch);

/**
 * Has engines keep a recording in memory, which `esl_engine_recording` returns.
 *
 * The caller sees to it that
 * `config` is settings, or null.
 */
esl_status esl_config_set_recording(const esl_config *config, bool is_recorded);

/**
 * Has engines replay a recording, which they copy: they call neither functions nor operations of the
 * embedder, ask no clock, and write nothing, but do the same as the recorded engine if they are given the
 * same definitions and texts. `esl_engine_canary` tells whether they did; a call returns `ESL_DIVERGED` when
 * they ask for something else. Such an engine waits for nothing: what came from outside comes again by
 * itself, so other threads need not send it. A question to it that was not recorded ends with `ESL_ENDED`.
 *
 * The caller sees to it that
 * `config` is settings and `recording` a recording; `failure` is a place that can be written, or null.
 */
esl_status esl_config_set_replay(const esl_config *config,
                                 const esl_recording *recording,
                                 esl_failure **failure);

/**
 * Copies what has been recorded of an engine so far.
 *
 * The caller sees to it that
 * `engine` is an engine; `recording` and `failure` are places that can be written, or null.
 */
esl_status esl_engine_recording(const esl_engine *engine, esl_recording **recording, esl_failure **failure);

/**
 * Frees a recording; null is ignored.
 *
 * The caller sees to it that
 * `recording` was not freed before.
 */
void esl_recording_free(esl_recording *recording);

/**
 * Returns the canary of the run so far: a hash of the turns of its tasks and of the questions to its host.
 * Runs with the same canary took the same course. Returns 0 if the engine is in a call.
 *
 * The caller sees to it that
 * `engine` is an engine, or null.
 */
uint64_t esl_engine_canary(const esl_engine *engine);

/**
 * Takes the answer if it has come; otherwise returns `ESL_PENDING`. An answer can be taken once.
 *
 * The caller sees to it that
 * `reply` is a reply; `value` and `failure` are places that can be written, or null.
 */
esl_status esl_reply_take(const esl_reply *reply, esl_value **value, esl_failure **failure);

/**
 * Waits for the answer, on a thread other than the engine's: an engine answers only while it runs.
 *
 * The caller sees to it that
 * `reply` is a reply that no other thread uses; `value` and `failure` are places that can be written, or
 * null.
 */
esl_status esl_reply_wait(const esl_reply *reply, esl_value **value, esl_failure **failure);

/**
 * Has `function` called once, when the answer has come or the engine is gone; at once if it has come
 * already. `esl_reply_take` then has the answer. One function at a time: a second one replaces the first. It
 * is called on the thread of the engine, while no task runs: it uses replies and handles only, and may free
 * this reply. `user` is freed after the call; with a status other than `ESL_OK` at once.
 *
 * The caller sees to it that
 * `reply` is a reply; `function` and `destructor` can be called with `user` on any thread; `failure` is a
 * place that can be written, or null.
 */
esl_status esl_reply_on_answer(const esl_reply *reply,
                               esl_notice_function function,
                               void *user,
                               esl_destructor destructor,
                               esl_failure **failure);

/**
 * Frees a reply; null is ignored.
 *
 * The caller sees to it that
 * `reply` was not freed before.
 */
void esl_reply_free(esl_reply *reply);

/**
 * Returns the version of ESL, such as "0.1.0": a text that is never freed. From any thread.
 */
const char *esl_version(void);

/**
 * Creates `NIL`. From any thread, as all functions for values.
 */
esl_value *esl_nil(void);

/**
 * Creates `T` or `NIL`.
 */
esl_value *esl_boolean(bool value);

/**
 * Creates an integer. `esl_value_read` makes larger ones.
 */
esl_value *esl_integer(int64_t value);

/**
 * Creates a double float.
 */
esl_value *esl_float(double value);

/**
 * Creates a string. Returns null unless the text is UTF-8.
 *
 * The caller sees to it that
 * `text` is a text with a null character at its end, or null.
 */
esl_value *esl_string(const char *text);

/**
 * Creates the keyword of this name, in any case: of "on" `:ON`.
 *
 * The caller sees to it that
 * `text` is a text with a null character at its end, or null.
 */
esl_value *esl_keyword(const char *text);

/**
 * Creates the symbol of this name, in any case, in the package `ESL-USER`.
 *
 * The caller sees to it that
 * `text` is a text with a null character at its end, or null.
 */
esl_value *esl_symbol(const char *text);

/**
 * Creates a string of `length` bytes of UTF-8, which may have null characters. Returns null if they are not.
 *
 * The caller sees to it that
 * `text` points to `length` bytes.
 */
esl_value *esl_string_of_length(const char *text, size_t length);

/**
 * Creates a vector of bytes.
 *
 * The caller sees to it that
 * `items` points to `count` elements.
 */
esl_value *esl_bytes(const uint8_t *items, size_t count);

/**
 * Creates a vector of integers.
 *
 * The caller sees to it that
 * `items` points to `count` elements.
 */
esl_value *esl_integers(const int64_t *items, size_t count);

/**
 * Creates a vector of double floats.
 *
 * The caller sees to it that
 * `items` points to `count` elements.
 */
esl_value *esl_floats(const double *items, size_t count);

/**
 * Creates a vector of floats, which are double floats in the program.
 *
 * The caller sees to it that
 * `items` points to `count` elements.
 */
esl_value *esl_floats_of_singles(const float *items, size_t count);

/**
 * Creates a list of `count` values, which are copied: `NIL` if there are none. Returns null if one is null.
 *
 * The caller sees to it that
 * `items` points to `count` values.
 */
esl_value *esl_list(const esl_value *const *items, size_t count);

/**
 * Creates a vector of `count` values, which are copied. Returns null if one is null.
 *
 * The caller sees to it that
 * `items` points to `count` values.
 */
esl_value *esl_vector(const esl_value *const *items, size_t count);

/**
 * Creates a hash table of `count` keys and as many values, which are copied: `items` has each key, followed
 * by its value. The program compares the keys by `equal`; of equal keys, the last one counts. Returns null
 * if one is null.
 *
 * The caller sees to it that
 * `items` points to twice `count` values.
 */
esl_value *esl_table(const esl_value *const *items, size_t count);

/**
 * Reads a value as programs write it: "(at ?robot (3.5 :north))".
 *
 * The caller sees to it that
 * `text` is a text with a null character at its end; `value` and `failure` are places that can be written,
 * or null.
 */
esl_status esl_value_read(const char *text, esl_value **value, esl_failure **failure);

/**
 * Copies a value. Returns null for null.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
esl_value *esl_value_copy(const esl_value *value);

/**
 * Frees a value that belongs to the caller; null is ignored.
 *
 * The caller sees to it that
 * `value` was not freed before, and is not a part of something else.
 */
void esl_value_free(esl_value *value);

/**
 * Returns the kind of a value; `ESL_NIL` for null.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
esl_kind esl_value_kind(const esl_value *value);

/**
 * Returns whether a value counts as true: whether it is neither `NIL` nor null.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
bool esl_value_is_true(const esl_value *value);

/**
 * Reads an integer of 64 bits.
 * Returns false, and stores nothing, for other values.
 *
 * The caller sees to it that
 * `value` is a value or null, and `result` a place that can be written.
 */
bool esl_value_integer(const esl_value *value, int64_t *result);

/**
 * Reads a float, or an integer of 64 bits as one.
 * Returns false, and stores nothing, for other values.
 *
 * The caller sees to it that
 * `value` is a value or null, and `result` a place that can be written.
 */
bool esl_value_float(const esl_value *value, double *result);

/**
 * Shows the bytes of a vector of bytes.
 * The result is a part of the value; it is null, with 0 in `length`, for other values.
 *
 * The caller sees to it that
 * `value` is a value or null, and `length` a place that can be written, or null.
 */
const uint8_t *esl_value_bytes(const esl_value *value, size_t *length);

/**
 * Shows the integers of a vector of integers.
 * The result is a part of the value; it is null, with 0 in `length`, for other values.
 *
 * The caller sees to it that
 * `value` is a value or null, and `length` a place that can be written, or null.
 */
const int64_t *esl_value_integers(const esl_value *value, size_t *length);

/**
 * Shows the floats of a vector of double floats.
 * The result is a part of the value; it is null, with 0 in `length`, for other values.
 *
 * The caller sees to it that
 * `value` is a value or null, and `length` a place that can be written, or null.
 */
const double *esl_value_floats(const esl_value *value, size_t *length);

/**
 * Shows the text of a string, or the name of a keyword or symbol, in UTF-8. It has no null character at
 * its end; `esl_value_text` copies it with one.
 * The result is a part of the value; it is null, with 0 in `length`, for other values.
 *
 * The caller sees to it that
 * `value` is a value or null, and `length` a place that can be written, or null.
 */
const uint8_t *esl_value_text_bytes(const esl_value *value, size_t *length);

/**
 * Returns the number of items of a list, vector or table, two for each key; 0 for other values.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
size_t esl_value_count(const esl_value *value);

/**
 * Returns an item of a list, vector or table, from 0. It is a part of the value. Returns null beyond the
 * last, and for vectors of numbers, whose elements other functions show.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
const esl_value *esl_value_item(const esl_value *value, size_t index);

/**
 * Copies the text of a string or a character, or the name of a keyword or symbol, for `esl_text_free`. Null
 * characters in it become U+FFFD. Returns null for other values.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
char *esl_value_text(const esl_value *value);

/**
 * Writes a value as the program prints it, for `esl_text_free`. Returns null for null.
 *
 * The caller sees to it that
 * `value` is a value, or null.
 */
char *esl_value_print(const esl_value *value);

/**
 * Frees a text that belongs to the caller; null is ignored.
 *
 * The caller sees to it that
 * `text` comes from a function that says so, and was not freed before.
 */
void esl_text_free(char *text);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ESL_H */
