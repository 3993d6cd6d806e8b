// The C++ API of ESL, the Execution Support Language: esl.h with owners, exceptions and types.
//
// Needs C++17. Objects free what they own; values convert from and to types of C++; a status other than ESL_OK is
// an exception esl::failure. Functions and operations of the program are lambdas, whose exceptions are failures of
// the call.
#ifndef ESL_HPP
#define ESL_HPP

#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "esl.h"

// ThreadSanitizer does not see the locks inside the library, by which an object goes from one thread to another.
#if defined(__SANITIZE_THREAD__)
#define ESL_THREAD_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define ESL_THREAD_SANITIZER 1
#endif
#endif
#ifdef ESL_THREAD_SANITIZER
extern "C" void __tsan_acquire(void *);
extern "C" void __tsan_release(void *);
#endif

namespace esl {

// Notes that an object is handed to another thread, and that it has come.
inline void note_sending([[maybe_unused]] void *object) {
#ifdef ESL_THREAD_SANITIZER
    __tsan_release(object);
#endif
}
inline void note_arrival([[maybe_unused]] void *object) {
#ifdef ESL_THREAD_SANITIZER
    __tsan_acquire(object);
#endif
}

// An owner of an object of C.
template <typename T, void (*Free)(T *)>
struct deleter {
    void operator()(T *object) const { Free(object); }
};
template <typename T, void (*Free)(T *)>
using owner = std::unique_ptr<T, deleter<T, Free>>;

// Returns a text that belongs to the caller as a string.
inline std::string take_text(char *text) {
    std::string result = text ? text : "";
    esl_text_free(text);
    return result;
}

template <typename T, typename = void>
struct conversion;

// A value of a program. It is never changed; copies are values of their own.
class value {
public:
    value() : value(esl_nil()) {}
    explicit value(esl_value *owned) : object(owned) {
        if (!object) throw std::invalid_argument("an invalid value: a text has to be UTF-8");
    }
    value(const value &other) : value(esl_value_copy(other.get())) {}
    value(value &&) noexcept = default;
    value &operator=(const value &other) { return *this = value(other); }
    value &operator=(value &&) noexcept = default;

    // Converts from integers, floats, bool, texts, vectors, optionals.
    template <typename T, typename = decltype(conversion<std::decay_t<const T &>>::to(std::declval<const T &>()))>
    value(const T &from) : value(conversion<std::decay_t<const T &>>::to(from)) {}

    static value keyword(const std::string &name) { return value(esl_keyword(name.c_str())); }
    static value symbol(const std::string &name) { return value(esl_symbol(name.c_str())); }
    static value nil() { return value(); }
    static value list(const std::vector<value> &items) { return of_items(items, esl_list); }
    static value vector(const std::vector<value> &items) { return of_items(items, esl_vector); }
    static value table(const std::vector<std::pair<value, value>> &entries) {
        std::vector<const esl_value *> pointers;
        for (const auto &entry : entries) pointers.insert(pointers.end(), {entry.first.get(), entry.second.get()});
        return value(esl_table(pointers.data(), entries.size()));
    }
    // Reads a value as programs write it.
    static value read(const std::string &text);
    // Reads a value from a text in JSON: objects are association lists, arrays vectors.
    static value of_json(const std::string &text);
    // Copies a part of something else.
    static value copy(const esl_value *part) { return part ? value(esl_value_copy(part)) : value(); }

    const esl_value *get() const { return object.get(); }
    esl_value *release() { return object.release(); }
    esl_kind kind() const { return esl_value_kind(get()); }
    bool is_true() const { return esl_value_is_true(get()); }
    // The items of a list or vector; of a table its keys, each followed by its value.
    std::size_t size() const { return esl_value_count(get()); }
    value operator[](std::size_t index) const { return copy(esl_value_item(get(), index)); }
    // The keys and values of a table; none for other values.
    std::vector<std::pair<value, value>> entries() const {
        std::vector<std::pair<value, value>> result;
        for (std::size_t i = 0; kind() == ESL_TABLE && i + 1 < size(); i += 2) {
            result.emplace_back((*this)[i], (*this)[i + 1]);
        }
        return result;
    }
    // The value of a key in a property list; nothing if it has none.
    std::optional<value> find(const std::string &key) const;
    // The value as the program prints it.
    std::string print() const { return take_text(esl_value_print(get())); }
    // The value as a text in JSON.
    std::string json() const;
    // The text of a string, or the name of a keyword or symbol.
    std::string text() const { return take_text(esl_value_text(get())); }

    // Converts to a type of C++; nothing if the value is not of that type.
    template <typename T>
    std::optional<T> try_as() const {
        return conversion<T>::from(get());
    }
    // Converts to a type of C++, or fails with :TYPE-ERROR.
    template <typename T>
    T as() const;

private:
    owner<esl_value, esl_value_free> object;

    static value of_items(const std::vector<value> &items,
                          esl_value *(*make)(const esl_value *const *, std::size_t)) {
        std::vector<const esl_value *> pointers;
        for (const value &item : items) pointers.push_back(item.get());
        return value(make(pointers.data(), pointers.size()));
    }
};

// A failure of a program, of a call, or for a function to fail with.
class failure : public std::runtime_error {
public:
    struct frame {
        std::string function, task, source;
        std::uint32_t line, column;
        bool is_of_library;
    };

    // A failure for a function or an operation to fail with: failure("valve-stuck", {3, "left"}).
    explicit failure(const std::string &cause, std::vector<value> arguments = {})
        : failure(made(cause, arguments)) {}
    explicit failure(esl_failure *owned)
        : std::runtime_error(esl_failure_message(owned)), object(owned, esl_failure_free) {}

    esl_status status() const { return esl_failure_status(object.get()); }
    // The cause as the program prints it: ":VALVE-STUCK".
    std::string cause() const { return esl_failure_cause(object.get()); }
    // Message, frames and what was being recovered from, as the commands print them.
    std::string report() const { return esl_failure_report(object.get()); }
    std::vector<value> arguments() const {
        std::vector<value> result;
        for (std::size_t i = 0; i < esl_failure_argument_count(object.get()); i++) {
            result.push_back(value::copy(esl_failure_argument(object.get(), i)));
        }
        return result;
    }
    std::vector<frame> frames() const {
        std::vector<frame> result;
        esl_frame read;
        while (esl_failure_frame(object.get(), result.size(), &read)) {
            result.push_back({read.function, read.task, read.source, read.line, read.column, read.is_of_library});
        }
        return result;
    }
    // The same failure, for C to own.
    esl_failure *copy_for_c() const { return made(cause(), arguments()); }

private:
    std::shared_ptr<esl_failure> object;

    static esl_failure *made(const std::string &cause, const std::vector<value> &arguments) {
        std::vector<const esl_value *> pointers;
        for (const value &argument : arguments) pointers.push_back(argument.get());
        esl_failure *result = esl_failure_new(cause.c_str(), pointers.data(), pointers.size());
        if (!result) throw std::invalid_argument("an invalid cause: it has to be UTF-8");
        return result;
    }
};

// Throws the failure of a call that has not returned ESL_OK. By reference, since the call that stores the failure
// may be evaluated after the other argument.
inline void require(esl_status status, esl_failure *const &object) {
    if (object) throw failure(object);
    if (status != ESL_OK) throw failure("invalid-argument");
}

inline value value::read(const std::string &text) {
    esl_value *result = nullptr;
    esl_failure *object = nullptr;
    require(esl_value_read(text.c_str(), &result, &object), object);
    return value(result);
}

inline value value::of_json(const std::string &text) {
    esl_value *result = nullptr;
    esl_failure *object = nullptr;
    require(esl_value_of_json(text.c_str(), &result, &object), object);
    return value(result);
}

inline std::string value::json() const {
    char *result = nullptr;
    esl_failure *object = nullptr;
    require(esl_value_json(get(), &result, &object), object);
    return take_text(result);
}

template <typename T>
T value::as() const {
    std::optional<T> result = try_as<T>();
    if (!result) throw failure("type-error", {*this, value(conversion<T>::name)});
    return *result;
}

inline std::optional<value> value::find(const std::string &key) const {
    for (std::size_t i = 0; i + 1 < size(); i += 2) {
        value name = (*this)[i];
        if (name.kind() == ESL_KEYWORD && name.print() == keyword(key).print()) return (*this)[i + 1];
    }
    return std::nullopt;
}

// ---- conversions

template <typename T>
struct conversion<T, std::enable_if_t<std::is_integral_v<T> && !std::is_same_v<T, bool>>> {
    static constexpr const char *name = "INTEGER";
    static value to(T from) {
        if constexpr (sizeof(T) == 8 && std::is_unsigned_v<T>) {
            if (from > static_cast<T>(INT64_MAX)) return value::read(std::to_string(from));
        }
        return value(esl_integer(static_cast<std::int64_t>(from)));
    }
    static std::optional<T> from(const esl_value *object) {
        std::int64_t read;
        if (!esl_value_integer(object, &read)) return std::nullopt;
        T result = static_cast<T>(read);
        bool fits = static_cast<std::int64_t>(result) == read && (read < 0) == (result < T(0));
        return fits ? std::optional<T>(result) : std::nullopt;
    }
};

template <typename T>
struct conversion<T, std::enable_if_t<std::is_floating_point_v<T>>> {
    static constexpr const char *name = "REAL";
    static value to(T from) { return value(esl_float(static_cast<double>(from))); }
    static std::optional<T> from(const esl_value *object) {
        double read;
        return esl_value_float(object, &read) ? std::optional<T>(static_cast<T>(read)) : std::nullopt;
    }
};

template <>
struct conversion<bool> {
    static constexpr const char *name = "T";
    static value to(bool from) { return value(esl_boolean(from)); }
    static std::optional<bool> from(const esl_value *object) { return esl_value_is_true(object); }
};

template <>
struct conversion<std::string> {
    static constexpr const char *name = "STRING";
    static value to(std::string_view from) { return value(esl_string_of_length(from.data(), from.size())); }
    static std::optional<std::string> from(const esl_value *object) {
        if (esl_value_kind(object) != ESL_STRING) return std::nullopt;
        std::size_t length;
        const std::uint8_t *bytes = esl_value_text_bytes(object, &length);
        return std::string(reinterpret_cast<const char *>(bytes), length);
    }
};
template <>
struct conversion<const char *> {
    static value to(const char *from) { return conversion<std::string>::to(from); }
};
template <>
struct conversion<std::string_view> {
    static value to(std::string_view from) { return conversion<std::string>::to(from); }
};

template <>
struct conversion<value> {
    static constexpr const char *name = "T";
    static std::optional<value> from(const esl_value *object) { return value::copy(object); }
};

// NIL is nothing.
template <typename T>
struct conversion<std::optional<T>> {
    static constexpr const char *name = conversion<T>::name;
    static value to(const std::optional<T> &from) { return from ? value(*from) : value(); }
    static std::optional<std::optional<T>> from(const esl_value *object) {
        if (!esl_value_is_true(object)) return std::optional<T>();
        std::optional<T> result = conversion<T>::from(object);
        return result ? std::optional<std::optional<T>>(result) : std::nullopt;
    }
};

// Bytes, integers of 64 bits and floats are vectors of numbers in the program, others are lists.
template <typename T>
struct conversion<std::vector<T>> {
    static constexpr const char *name = "SEQUENCE";
    static value to(const std::vector<T> &from) {
        if constexpr (std::is_same_v<T, std::uint8_t>) return value(esl_bytes(from.data(), from.size()));
        else if constexpr (std::is_same_v<T, std::int64_t>) return value(esl_integers(from.data(), from.size()));
        else if constexpr (std::is_same_v<T, double>) return value(esl_floats(from.data(), from.size()));
        else if constexpr (std::is_same_v<T, float>) {
            return value(esl_floats_of_singles(from.data(), from.size()));
        } else {
            return value::list(std::vector<value>(from.begin(), from.end()));
        }
    }
    static std::optional<std::vector<T>> from(const esl_value *object) {
        std::size_t length;
        if constexpr (std::is_arithmetic_v<T>) {
            if (auto *bytes = esl_value_bytes(object, &length)) return copy(bytes, length);
            if (auto *integers = esl_value_integers(object, &length)) return copy(integers, length);
            if (auto *floats = esl_value_floats(object, &length)) return copy(floats, length);
        }
        esl_kind kind = esl_value_kind(object);
        if (kind != ESL_NIL && kind != ESL_LIST && kind != ESL_VECTOR) return std::nullopt;
        std::vector<T> result;
        for (std::size_t i = 0; i < esl_value_count(object); i++) {
            std::optional<T> item = conversion<T>::from(esl_value_item(object, i));
            if (!item) return std::nullopt;
            result.push_back(std::move(*item));
        }
        return result;
    }

private:
    template <typename S>
    static std::optional<std::vector<T>> copy(const S *items, std::size_t length) {
        std::vector<T> result;
        result.reserve(length);
        for (std::size_t i = 0; i < length; i++) {
            T item = static_cast<T>(items[i]);
            if (static_cast<S>(item) != items[i] && !std::is_floating_point_v<T>) return std::nullopt;
            result.push_back(item);
        }
        return result;
    }
};

// Name of a class whose objects programs hold, by std::shared_ptr:
//
//     template <> inline constexpr const char *esl::object_name<motor> = "MOTOR";
template <typename T>
inline constexpr const char *object_name = nullptr;

template <typename T>
struct conversion<std::shared_ptr<T>, std::enable_if_t<(object_name<T> != nullptr)>> {
    static constexpr const char *name = object_name<T>;
    static value to(const std::shared_ptr<T> &from) {
        auto destroy = [](void *pointer) { delete static_cast<std::shared_ptr<T> *>(pointer); };
        return value(esl_object(name, "", new std::shared_ptr<T>(from), destroy));
    }
    static std::optional<std::shared_ptr<T>> from(const esl_value *object) {
        auto *pointer = static_cast<std::shared_ptr<T> *>(esl_value_object(object, name));
        return pointer ? std::optional<std::shared_ptr<T>>(*pointer) : std::nullopt;
    }
};

// ---- functions of C++

// The types of the parameters of a function object.
template <typename F>
struct parameters : parameters<decltype(&F::operator())> {};
template <typename C, typename R, typename... A>
struct parameters<R (C::*)(A...) const> {
    using tuple = std::tuple<std::decay_t<A>...>;
    using result = R;
};
template <typename C, typename R, typename... A>
struct parameters<R (C::*)(A...)> : parameters<R (C::*)(A...) const> {};
template <typename R, typename... A>
struct parameters<R (*)(A...)> {
    using tuple = std::tuple<std::decay_t<A>...>;
    using result = R;
};

// Returns the failure of an exception that is being handled, for C to own.
inline esl_failure *current_failure() {
    try {
        throw;
    } catch (const failure &thrown) {
        return thrown.copy_for_c();
    } catch (const std::exception &thrown) {
        return failure("simple-error", {value(std::string(thrown.what()))}).copy_for_c();
    } catch (...) {
        return failure("simple-error", {value("an exception of C++")}).copy_for_c();
    }
}

template <typename T>
T argument(const esl_value *const *arguments, std::size_t count, std::size_t index) {
    const esl_value *object = index < count ? arguments[index] : nullptr;
    std::optional<T> result = conversion<T>::from(object);
    if (!result) throw failure("type-error", {value::copy(object), value(conversion<T>::name)});
    return *result;
}

template <typename F, std::size_t... I>
value apply(F &function, const esl_value *const *arguments, std::size_t count, std::index_sequence<I...>) {
    using tuple = typename parameters<F>::tuple;
    if constexpr (std::is_void_v<typename parameters<F>::result>) {
        function(argument<std::tuple_element_t<I, tuple>>(arguments, count, I)...);
        return value();
    } else {
        return value(function(argument<std::tuple_element_t<I, tuple>>(arguments, count, I)...));
    }
}

template <typename F>
esl_failure *call(void *user, const esl_value *const *arguments, std::size_t count, esl_value **result) {
    using indices = std::make_index_sequence<std::tuple_size_v<typename parameters<F>::tuple>>;
    try {
        *result = apply(*static_cast<F *>(user), arguments, count, indices()).release();
        return nullptr;
    } catch (...) {
        return current_failure();
    }
}

template <typename F>
void destroy(void *user) {
    delete static_cast<F *>(user);
}

// Calls a function with the arguments of an operation, converted to the types of its parameters.
template <typename F, typename O, std::size_t... I>
auto apply_to(F &function, const O &work, std::index_sequence<I...>) {
    using tuple = typename parameters<F>::tuple;
    (void)work;
    return function(work.template argument<std::tuple_element_t<I, tuple>>(I)...);
}

// Work for a task of the program, which waits for its end. Ends once, on any thread; one that is destroyed has
// failed with :OPERATION-DROPPED.
class operation {
public:
    explicit operation(esl_operation *owned) : object(owned) {}

    std::size_t argument_count() const { return esl_operation_argument_count(object.get()); }
    template <typename T = value>
    T argument(std::size_t index) const {
        return value::copy(esl_operation_argument(object.get(), index)).as<T>();
    }
    void complete(const value &result = value()) { esl_operation_complete(object.release(), result.get()); }
    void fail(const failure &reason) { esl_operation_fail(object.release(), reason.copy_for_c()); }
    // Waits for a future, whose value or exception ends the operation.
    template <typename R>
    void complete_with(std::future<R> &result) {
        try {
            if constexpr (std::is_void_v<R>) {
                result.get();
                complete();
            } else {
                complete(value(result.get()));
            }
        } catch (...) {
            fail(failure(current_failure()));
        }
    }
    void report_progress(const value &progress) { esl_operation_report_progress(object.get(), progress.get()); }
    bool is_cancelled() const { return esl_operation_is_cancelled(object.get()); }
    // The identity of the call in a durable run; empty elsewhere.
    std::string action() const {
        const char *text = esl_operation_action(object.get());
        return text ? text : "";
    }
    // Keeps bytes with the state of a durable run. False if they cannot be kept: then the operation does not go on.
    bool save(std::string_view state) {
        return esl_operation_save(object.get(), state.data(), state.size()) == ESL_OK;
    }
    // The bytes that the operation had saved last, in an earlier process.
    std::optional<std::string_view> restore() const {
        std::size_t length = 0;
        const void *bytes = esl_operation_restore(object.get(), &length);
        if (!bytes) return std::nullopt;
        return std::string_view(static_cast<const char *>(bytes), length);
    }
    // Has a function called when the program leaves the call. It only hands on the message.
    template <typename F>
    void on_cancel(F function) {
        auto call = [](void *user) { (*static_cast<F *>(user))(); };
        esl_operation_on_cancel(object.get(), call, new F(std::move(function)), destroy<F>);
    }

private:
    owner<esl_operation, esl_operation_free> object;
};

// ---- engines

// An answer to come.
class reply {
public:
    explicit reply(esl_reply *owned) : object(owned) {}

    // The answer, if it has come and was not taken before.
    std::optional<value> take() {
        esl_value *result = nullptr;
        esl_failure *thrown = nullptr;
        esl_status status = esl_reply_take(object.get(), &result, &thrown);
        if (status == ESL_PENDING) return std::nullopt;
        require(status, thrown);
        return value(result);
    }
    // The answer as a future, which is ready when the answer has come, or has the failure of the call. Some thread
    // runs the engine meanwhile: a wait on that thread would wait for ever.
    template <typename T = value>
    std::future<T> future() && {
        struct waiting {
            reply asked;
            std::promise<T> promise;
        };
        auto state = std::make_unique<waiting>(waiting{std::move(*this), {}});
        std::future<T> result = state->promise.get_future();
        auto call = [](void *user) {
            note_arrival(user);
            auto *come = static_cast<waiting *>(user);
            try {
                if constexpr (std::is_void_v<T>) {
                    come->asked.take();
                    come->promise.set_value();
                } else {
                    come->promise.set_value(come->asked.take().value().template as<T>());
                }
            } catch (...) {
                come->promise.set_exception(std::current_exception());
            }
        };
        const esl_reply *asked = state->asked.object.get();
        note_sending(state.get());
        esl_failure *thrown = nullptr;
        require(esl_reply_on_answer(asked, call, state.release(), destroy<waiting>, &thrown), thrown);
        return result;
    }
    // Waits for the answer, on a thread other than the engine's.
    value wait() {
        esl_value *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_reply_wait(object.get(), &result, &thrown), thrown);
        return value(result);
    }

private:
    owner<esl_reply, esl_reply_free> object;
};

// A task that was started from outside.
class task {
public:
    explicit task(esl_task *owned) : object(owned) {}

    // Has it unwind and run its cleanups.
    void abort() { esl_task_abort(object.get()); }
    // The first value of its function, to come.
    reply result() && { return reply(esl_task_into_reply(object.release())); }

private:
    owner<esl_task, esl_task_free> object;
};

// An event of a run, for an observer.
struct seen {
    esl_event event;
    // Since the first observer came.
    std::chrono::nanoseconds time;
    // Numbers of tasks; 0 for none.
    std::uint64_t task, other_task;
    // Whether the task, where it begins, belongs to the library.
    bool is_hidden;
    std::string_view text;
};

// A watch over facts, or over all events of a run, until it is destroyed.
class watch {
public:
    explicit watch(esl_watch *owned) : object(owned) {}

private:
    owner<esl_watch, esl_watch_free> object;
};

// A way into a run, from all threads.
class handle {
public:
    explicit handle(esl_handle *owned) : object(owned) {}
    handle(const handle &other) : object(esl_handle_copy(other.object.get())) {}
    handle(handle &&) noexcept = default;

    void signal(const std::string &input, const std::vector<value> &arguments = {}) {
        signal(input, arguments, true);
    }
    // Returns false if the input is full, and its rule is that senders wait.
    bool try_signal(const std::string &input, const std::vector<value> &arguments = {}) {
        return signal(input, arguments, false);
    }
    reply assert_fact(const value &fact) { return ask(esl_handle_assert, fact); }
    reply retract(const value &pattern) { return ask(esl_handle_retract, pattern); }
    // The answer is a list of property lists, one for each answer of the database.
    reply query(const value &pattern) { return ask(esl_handle_query, pattern); }
    reply set(const std::string &property, const value &state, const std::vector<value> &arguments = {}) {
        std::vector<const esl_value *> pointers = pointers_to(arguments);
        esl_reply *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_handle_set(object.get(), property.c_str(), pointers.data(), pointers.size(), state.get(),
                               &result, &thrown),
                thrown);
        return reply(result);
    }
    reply call(const std::string &function, const std::vector<value> &arguments = {}) {
        std::vector<const esl_value *> pointers = pointers_to(arguments);
        esl_reply *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_handle_call(object.get(), function.c_str(), pointers.data(), pointers.size(), &result, &thrown),
                thrown);
        return reply(result);
    }
    esl::task spawn(const std::string &function, const std::vector<value> &arguments = {}) {
        std::vector<const esl_value *> pointers = pointers_to(arguments);
        esl_task *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_handle_spawn(object.get(), function.c_str(), pointers.data(), pointers.size(), &result, &thrown),
                thrown);
        return esl::task(result);
    }
    // The tasks that have not ended: property lists with number, maker, name, waits-for and ticks.
    reply tasks() {
        esl_reply *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_handle_tasks(object.get(), &result, &thrown), thrown);
        return reply(result);
    }
    // Aborts the task with this number. Nothing happens if it has ended.
    void abort(std::uint64_t task) { esl_handle_abort(object.get(), task); }
    // Has a function called with each event of the run (esl::seen), on the thread of the engine.
    template <typename F>
    void subscribe(F observer) {
        subscribe(std::move(observer), nullptr);
    }
    // The same, until the watch is destroyed.
    template <typename F>
    [[nodiscard]] esl::watch watch_run(F observer) {
        esl_watch *watch = nullptr;
        subscribe(std::move(observer), &watch);
        return esl::watch(watch);
    }
    void pause() { esl_handle_pause(object.get()); }
    void resume() { esl_handle_resume(object.get()); }
    void stop() { esl_handle_stop(object.get()); }
    void terminate() { esl_handle_terminate(object.get()); }

    static std::vector<const esl_value *> pointers_to(const std::vector<value> &values) {
        std::vector<const esl_value *> pointers;
        for (const value &item : values) pointers.push_back(item.get());
        return pointers;
    }

private:
    owner<esl_handle, esl_handle_free> object;

    template <typename F>
    void subscribe(F observer, esl_watch **watch) {
        auto call = [](void *user, const esl_seen *event) {
            try {
                (*static_cast<F *>(user))(seen{event->event, std::chrono::nanoseconds(event->time), event->task,
                                               event->other_task, event->is_hidden, event->text});
            } catch (...) {
                // Nothing waits for it, and the run goes on.
            }
        };
        esl_failure *thrown = nullptr;
        require(esl_handle_subscribe(object.get(), call, new F(std::move(observer)), destroy<F>, watch, &thrown),
                thrown);
    }
    template <typename F>
    reply ask(F question, const value &asked) {
        esl_reply *result = nullptr;
        esl_failure *thrown = nullptr;
        require(question(object.get(), asked.get(), &result, &thrown), thrown);
        return reply(result);
    }
    bool signal(const std::string &input, const std::vector<value> &arguments, bool waits) {
        std::vector<const esl_value *> pointers = pointers_to(arguments);
        esl_failure *thrown = nullptr;
        esl_status status = esl_handle_signal(object.get(), input.c_str(), pointers.data(), pointers.size(), waits,
                                              &thrown);
        if (status == ESL_FULL) {
            esl_failure_free(thrown);
            return false;
        }
        require(status, thrown);
        return true;
    }
};

// Everything that a run has learnt from outside, for a replay. Copies are the same recording.
class recording {
public:
    explicit recording(esl_recording *owned) : object(owned, esl_recording_free) {}
    const esl_recording *get() const { return object.get(); }

private:
    std::shared_ptr<esl_recording> object;
};

// Settings of an engine.
struct settings {
    std::optional<std::size_t> memory = std::nullopt;
    std::optional<std::uint64_t> budget = std::nullopt;
    std::optional<std::uint64_t> ticks = std::nullopt;
    std::optional<std::uint64_t> seed = std::nullopt;
    bool has_virtual_time = false;
    // Rights as in --allow-…: "net=127.0.0.1:1883".
    std::vector<std::string> allow = {};
    // Takes what programs write, in place of the streams of the process.
    std::function<void(std::string_view)> output = nullptr;
    // Keeps a recording, which engine::recording returns.
    bool is_recorded = false;
    // Repeats a recording, without the outside.
    std::optional<recording> replayed = std::nullopt;
};

// A machine in which programs run. It serves one thread at a time.
class engine {
public:
    explicit engine(const settings &wanted = {}) {
        owner<esl_config, esl_config_free> config(esl_config_new());
        esl_failure *thrown = nullptr;
        if (wanted.memory) esl_config_set_memory(config.get(), *wanted.memory);
        if (wanted.budget) esl_config_set_budget(config.get(), *wanted.budget);
        if (wanted.ticks) esl_config_set_ticks(config.get(), *wanted.ticks);
        if (wanted.seed) esl_config_set_seed(config.get(), *wanted.seed);
        esl_config_set_virtual_time(config.get(), wanted.has_virtual_time);
        for (const std::string &right : wanted.allow) {
            require(esl_config_allow(config.get(), right.c_str(), &thrown), thrown);
        }
        if (wanted.output) {
            using function = std::function<void(std::string_view)>;
            auto write = [](void *user, const char *bytes, std::size_t length) {
                try {
                    (*static_cast<function *>(user))(std::string_view(bytes, length));
                } catch (...) {
                    // The program does not learn what becomes of its output.
                }
            };
            require(esl_config_set_output(config.get(), write, new function(wanted.output), destroy<function>, &thrown),
                    thrown);
        }
        esl_config_set_recording(config.get(), wanted.is_recorded);
        if (wanted.replayed) {
            require(esl_config_set_replay(config.get(), wanted.replayed->get(), &thrown), thrown);
        }
        esl_engine *made = nullptr;
        require(esl_engine_new(config.get(), &made, &thrown), thrown);
        object.reset(made);
    }

    value eval(const std::string &text) { return evaluate(esl_eval, text); }
    value load(const std::string &path) { return evaluate(esl_load, path); }
    value call(const std::string &function, const std::vector<value> &arguments = {}) {
        std::vector<const esl_value *> pointers = handle::pointers_to(arguments);
        esl_value *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_call(object.get(), function.c_str(), pointers.data(), pointers.size(), &result, &thrown), thrown);
        return value(result);
    }
    // Defines a function: its arguments are converted to the types of the parameters.
    template <typename F>
    void define(const std::string &name, const std::string &lambda_list, const std::string &documentation,
                F function) {
        esl_failure *thrown = nullptr;
        require(esl_define(object.get(), name.c_str(), lambda_list.c_str(), documentation.c_str(), esl::call<F>,
                           new F(std::move(function)), destroy<F>, &thrown),
                thrown);
    }
    // Defines a function whose calls are operations: `begin` gets an esl::operation, which it moves to a thread or
    // a queue.
    template <typename F>
    void define_operation(const std::string &name, const std::string &lambda_list,
                          const std::string &documentation, F begin) {
        auto call = [](void *user, esl_operation *begun) {
            operation work(begun);
            try {
                (*static_cast<F *>(user))(std::move(work));
            } catch (...) {
                // The operation is destroyed, which is how the program learns of it.
            }
        };
        esl_failure *thrown = nullptr;
        require(esl_define_operation(object.get(), name.c_str(), lambda_list.c_str(), documentation.c_str(), call,
                                     new F(std::move(begin)), destroy<F>, &thrown),
                thrown);
    }
    // Defines an operation whose work is a std::future, which `begin` returns: define_async("drive", "(metres)", "…",
    // [](double metres) { return std::async(std::launch::async, drive, metres); }). The arguments are converted to
    // the types of the parameters, and the value of the future to the value of the call; its exception is the
    // failure. A future tells nobody that it is ready, so each call has a thread that waits for it, also after the
    // program has left the call: a device that is to stop then takes an esl::operation and `on_cancel` instead.
    template <typename F>
    void define_async(const std::string &name, const std::string &lambda_list, const std::string &documentation,
                      F begin) {
        using arguments = typename parameters<F>::tuple;
        auto perform = [begin = std::move(begin)](operation work) mutable {
            try {
                auto future = apply_to(begin, work, std::make_index_sequence<std::tuple_size_v<arguments>>());
                std::thread([work = std::move(work), future = std::move(future)]() mutable {
                    work.complete_with(future);
                }).detach();
            } catch (...) {
                work.fail(failure(current_failure()));
            }
        };
        define_operation(name, lambda_list, documentation, std::move(perform));
    }
    esl::handle handle() const {
        esl_handle *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_engine_handle(object.get(), &result, &thrown), thrown);
        return esl::handle(result);
    }
    // Has a text evaluated as a task of the runs to come.
    reply begin(const std::string &text) {
        esl_reply *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_begin(object.get(), text.c_str(), &result, &thrown), thrown);
        return reply(result);
    }
    esl_progress run() {
        esl_progress progress;
        esl_failure *thrown = nullptr;
        require(esl_run(object.get(), &progress, &thrown), thrown);
        return progress;
    }
    esl_progress poll(std::uint64_t ticks) {
        esl_progress progress;
        esl_failure *thrown = nullptr;
        require(esl_poll(object.get(), ticks, &progress, &thrown), thrown);
        return progress;
    }
    // Makes the definitions of a text in the program, all at once or none of them. Returns their number.
    std::size_t patch(const std::string &text, const std::string &name = "patch") {
        std::size_t count = 0;
        esl_failure *thrown = nullptr;
        require(esl_patch(object.get(), name.c_str(), text.c_str(), &count, &thrown), thrown);
        return count;
    }
    // Takes the newest patch back. Returns the number of its definitions; 0 if there is no patch.
    std::size_t undo_patch() {
        std::size_t count = 0;
        esl_failure *thrown = nullptr;
        require(esl_undo_patch(object.get(), &count, &thrown), thrown);
        return count;
    }
    // The definitions of a package: property lists with kind, name, parameters and documentation.
    value definitions(const std::string &package = "esl-user") { return evaluate(esl_definitions, package); }
    // Has function(bool is_there, esl::value fact, esl::value bindings) called for each change of a fact that
    // matches a pattern, on the thread of the engine, until the watch is destroyed.
    template <typename F>
    esl::watch watch_facts(const value &pattern, F function) {
        auto tell = [](void *user, bool is_there, const esl_value *fact, const esl_value *bindings) {
            try {
                (*static_cast<F *>(user))(is_there, value::copy(fact), value::copy(bindings));
            } catch (...) {
                // Nothing waits for it, and the run goes on.
            }
        };
        esl_watch *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_watch_facts(object.get(), pattern.get(), tell, new F(std::move(function)), destroy<F>, &result,
                                &thrown),
                thrown);
        return esl::watch(result);
    }
    // What was recorded so far.
    esl::recording recording() const {
        esl_recording *result = nullptr;
        esl_failure *thrown = nullptr;
        require(esl_engine_recording(object.get(), &result, &thrown), thrown);
        return esl::recording(result);
    }
    // Runs with the same canary took the same course.
    std::uint64_t canary() const { return esl_engine_canary(object.get()); }
    int wakeup_fd() {
        int descriptor = -1;
        esl_failure *thrown = nullptr;
        require(esl_wakeup_fd(object.get(), &descriptor, &thrown), thrown);
        return descriptor;
    }

private:
    struct freeing {
        void operator()(esl_engine *freed) const { esl_engine_free(freed); }
    };
    std::unique_ptr<esl_engine, freeing> object;

    template <typename F>
    value evaluate(F function, const std::string &text) {
        esl_value *result = nullptr;
        esl_failure *thrown = nullptr;
        require(function(object.get(), text.c_str(), &result, &thrown), thrown);
        return value(result);
    }
};

}  // namespace esl

#endif
