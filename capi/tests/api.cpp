// What the C++ API promises: each check prints its line if it does not hold.
#include "esl.hpp"

#include <future>
#include <iostream>
#include <thread>

static int faults = 0;

#define CHECK(condition)                                                            \
    do {                                                                            \
        if (!(condition)) {                                                         \
            std::cout << "line " << __LINE__ << ": " << #condition << std::endl;    \
            faults++;                                                               \
        }                                                                           \
    } while (0)

template <typename F>
static std::string cause_of(F function) {
    try {
        function();
    } catch (const esl::failure &thrown) {
        return thrown.cause();
    }
    return "nothing";
}

static void values() {
    CHECK(esl::value(42).as<int>() == 42);
    CHECK(!esl::value(300).try_as<std::uint8_t>() && !esl::value(-1).try_as<unsigned>());
    CHECK(esl::value(std::uint64_t(-1)).print() == "18446744073709551615");
    CHECK(esl::value("ridge").as<std::string>() == "ridge");
    CHECK(esl::value(std::string("a\0b", 3)).as<std::string>().size() == 3);
    CHECK(esl::value(std::vector<float>{0.5f, 2.0f}).as<std::vector<double>>()[1] == 2.0);
    CHECK(!esl::value(std::vector<double>{0.5}).try_as<std::vector<int>>());
    CHECK(esl::value(std::vector<std::string>{"a", "b"}).print() == "(\"a\" \"b\")");
    CHECK(esl::value(std::optional<int>()).print() == "NIL");
    CHECK(esl::value::read("(:robot rover)").find("robot")->text() == "ROVER");
    CHECK(cause_of([] { esl::value::read("(1"); }) == ":COMPILATION-FAILED");
    CHECK(cause_of([] { esl::value(1.5).as<int>(); }) == ":TYPE-ERROR");
}

struct motor {
    double power = 0;
};
template <>
inline constexpr const char *esl::object_name<motor> = "MOTOR";

static void objects() {
    std::weak_ptr<motor> alive;
    {
        esl::engine engine;
        engine.define("motor", "()", "A motor.", [&] {
            auto made = std::make_shared<motor>();
            alive = made;
            return made;
        });
        engine.define("set-power", "(motor power)", "The power.", [](std::shared_ptr<motor> motor, double power) {
            return motor->power = power;
        });
        CHECK(engine.eval("(let ((m (motor))) (list (set-power m 2) m (eq m m)))").print() == "(2.0 #<MOTOR> T)");
        CHECK(cause_of([&] { engine.eval("(set-power 1 2)"); }) == ":TYPE-ERROR");
        CHECK(engine.eval("(defparameter *m* (motor))").text() == "*M*" && !alive.expired());
        CHECK(engine.eval("*m*").as<std::shared_ptr<motor>>()->power == 0);
    }
    CHECK(alive.expired());
}

static void tables() {
    esl::engine engine;
    esl::value table = esl::value::table({{"ridge", 0.5}, {2, esl::value::list({1})}});
    CHECK(engine.call("hash-table-count", {table}).as<int>() == 2);
    CHECK(engine.call("gethash", {"ridge", table}).as<double>() == 0.5);
    esl::value made = engine.eval("(let ((table (make-hash-table))) (setf (gethash :on table) 3) table)");
    CHECK(made.entries().size() == 1 && made.entries()[0].first.text() == "ON");
    CHECK(made.entries()[0].second.as<int>() == 3 && made[1].as<int>() == 3);
    CHECK(made.json() == "{\"on\":3}" && esl::value(1).entries().empty());
}

static void json() {
    esl::value read = esl::value::of_json("{\"a\": [1, 2.5, null], \"b\": {\"c\": true}}");
    CHECK(read.print() == "((\"a\" . #(1 2.5 :NULL)) (\"b\" (\"c\" . T)))");
    CHECK(read.json() == "{\"a\":[1,2.5,null],\"b\":{\"c\":true}}");
    CHECK(cause_of([] { esl::value::of_json("[1"); }) == ":NOT-OF-TYPE");
}

static void watching() {
    std::string printed, told;
    esl::settings settings;
    settings.output = [&](std::string_view text) { printed += text; };
    settings.is_recorded = true;
    settings.seed = 5;
    esl::engine engine(settings);
    engine.handle().subscribe([&](const esl::seen &event) {
        if (event.event == ESL_FACT_ASSERTED) told += event.text;
    });
    engine.define("roll", "()", "A number.", [] { return 4; });
    const char *text = "(progn (assert '(at rover ridge)) (princ (list (roll) (random 1000))) (get-universal-time))";
    esl::value time = engine.eval(text);
    CHECK(told.find("ROVER RIDGE") != std::string::npos && printed.substr(0, 3) == "(4 ");
    settings.replayed = engine.recording();
    std::string repeated;
    settings.output = [&](std::string_view text) { repeated += text; };
    esl::engine replay(settings);
    replay.handle().subscribe([](const esl::seen &) {});
    replay.define("roll", "()", "A number.", []() -> int { throw std::runtime_error("it is not called"); });
    CHECK(replay.eval(text).print() == time.print() && repeated == printed);
    CHECK(replay.canary() == engine.canary());
    int watched = 0;
    {
        esl::watch watch = engine.handle().watch_run([&](const esl::seen &event) {
            if (event.event == ESL_FACT_ASSERTED) watched++;
        });
        engine.eval("(assert '(at rover dock))");
    }
    engine.eval("(assert '(at rover lander))");
    CHECK(watched == 1);
    esl::task patrol = engine.handle().spawn("sleep", {3600});
    patrol.abort();
    engine.run();
    CHECK(cause_of([&] { std::move(patrol).result().wait(); }) == ":ABORTED");
}

static void definitions() {
    esl::engine engine;
    engine.define("drive", "(metres &key (speed 0.1))", "Drives.", [](double metres, double) { return metres; });
    engine.eval("(progn (defun pace () 1) (define-input scan))");
    esl::value rows = engine.definitions();
    CHECK(rows.size() == 3 && rows[0].find("name")->text() == "DRIVE");
    CHECK(rows[0].find("documentation")->text() == "Drives." && rows[2].find("kind")->text() == "INPUT");
    CHECK(engine.patch("(defun pace () 2) (defun fresh () 3)") == 2);
    CHECK(engine.eval("(list (pace) (fresh))").print() == "(2 3)");
    CHECK(engine.undo_patch() == 2 && engine.undo_patch() == 0);
    CHECK(engine.eval("(list (pace) (fboundp 'fresh))").print() == "(1 NIL)");
    CHECK(cause_of([&] { engine.patch("(print 1)"); }) != "nothing");
    std::string told;
    {
        esl::watch watch = engine.watch_facts(esl::value::read("(at ?robot ?place)"),
                                              [&](bool is_there, esl::value fact, esl::value bindings) {
                                                  told += is_there ? "+" : "-";
                                                  told += fact.print() + bindings.find("place")->text();
                                              });
        engine.eval("(progn (assert '(at rover ridge)) (assert '(charge 5)) (retract '(at ? ?)) (sleep 0.01))");
    }
    engine.eval("(progn (assert '(at rover base)) (sleep 0.01))");
    CHECK(told == "+(AT ROVER RIDGE)RIDGE-(AT ROVER RIDGE)RIDGE");
    try {
        engine.eval("(exit 3)");
        CHECK(false);
    } catch (const esl::failure &thrown) {
        CHECK(thrown.status() == ESL_PROGRAM_EXITED && thrown.arguments()[0].as<int>() == 3);
    }
}

static void functions() {
    esl::engine engine;
    engine.define("area", "(width &optional height)", "An area.",
                  [](double width, std::optional<double> height) { return width * height.value_or(width); });
    CHECK(engine.eval("(list (area 3) (area 3 4))").print() == "(9.0 12.0)");
    CHECK(cause_of([&] { engine.eval("(area :wide)"); }) == ":TYPE-ERROR");
    engine.define("stick", "()", "Fails.", []() -> int { throw esl::failure("valve-stuck", {3, "left"}); });
    CHECK(engine.eval("(handler-case (stick) (failure (f) (failure-arguments f)))").print() == "(3 \"left\")");
    engine.define("loosen", "()", "Fails.", []() { throw std::runtime_error("a bolt is loose"); });
    try {
        engine.eval("(loosen)");
        CHECK(false);
    } catch (const esl::failure &thrown) {
        CHECK(std::string(thrown.what()).find("a bolt is loose") != std::string::npos);
        CHECK(!thrown.frames().empty() && thrown.report().size() > 10);
    }
}

static void operations() {
    esl::engine engine;
    engine.define_operation("drive", "(metres)", "Drives.", [](esl::operation work) {
        std::thread([work = std::move(work)]() mutable {
            double metres = work.argument<double>(0);
            if (metres > 10) return work.fail(esl::failure("obstacle", {7}));
            work.complete(metres);
        }).detach();
    });
    engine.define_operation("lose", "()", "Is dropped.", [](esl::operation) {});
    CHECK(engine.eval("(drive 3)").as<double>() == 3.0);
    CHECK(cause_of([&] { engine.eval("(drive 50)"); }) == ":OBSTACLE");
    CHECK(cause_of([&] { engine.eval("(lose)"); }) == ":OPERATION-DROPPED");
}

static void futures() {
    esl::engine engine;
    engine.define_async("survey", "(metres &optional name)", "Looks.",
                        [](double metres, std::optional<std::string> name) {
                            return std::async(std::launch::async, [=]() -> std::vector<double> {
                                if (metres > 10) throw esl::failure("obstacle", {7});
                                if (name) throw std::runtime_error(*name + " is dark");
                                return {metres, 2 * metres};
                            });
                        });
    engine.define_async("halt", "()", "Stops.", [] { return std::async(std::launch::async, [] {}); });
    CHECK(engine.eval("(list (survey 3) (halt))").print() == "(#(3.0 6.0) NIL)");
    CHECK(cause_of([&] { engine.eval("(survey 50)"); }) == ":OBSTACLE");
    CHECK(cause_of([&] { engine.eval("(survey :far)"); }) == ":TYPE-ERROR");
    try {
        engine.eval("(survey 3 \"the ridge\")");
        CHECK(false);
    } catch (const esl::failure &thrown) {
        CHECK(std::string(thrown.what()).find("the ridge is dark") != std::string::npos);
    }
    engine.eval("(progn (define-input over) (defun double (n) (* 2 n)))");
    esl::handle handle = engine.handle();
    std::thread other([handle]() mutable {
        std::future<int> doubled = handle.call("double", {21}).future<int>();
        std::future<esl::value> failed = handle.call("fail", {esl::value::keyword("lost")}).future();
        std::future<std::string> mistaken = handle.call("double", {1}).future<std::string>();
        std::future<void> over = handle.spawn("sleep", {0.001}).result().future<void>();
        CHECK(doubled.get() == 42);
        CHECK(cause_of([&] { failed.get(); }) == ":LOST");
        CHECK(cause_of([&] { mistaken.get(); }) == ":TYPE-ERROR");
        over.get();
        handle.signal("over");
    });
    engine.eval("(wait-for-event over)");
    other.join();
    esl::reply come = engine.begin("(list 1)");
    engine.run();
    std::future<esl::value> ready = std::move(come).future();
    CHECK(ready.wait_for(std::chrono::seconds(0)) == std::future_status::ready && ready.get().print() == "(1)");
    std::future<esl::value> never;
    {
        esl::engine brief;
        never = brief.begin("(sleep 1000)").future();
        CHECK(never.wait_for(std::chrono::seconds(0)) == std::future_status::timeout);
    }
    CHECK(cause_of([&] { never.get(); }) == ":ENDED");
}

static void divergence() {
    esl::settings settings;
    settings.is_recorded = true;
    esl::engine engine(settings);
    engine.eval("(get-universal-time)");
    settings.replayed = engine.recording();
    esl::engine replay(settings);
    esl::reply answer = replay.begin("(wait-for-event (make-event))");
    CHECK(replay.poll(1000).state == ESL_DONE);
    CHECK(cause_of([&] { answer.wait(); }) == ":ENDED");
    // An operation of which the recording has nothing.
    esl::engine other(settings);
    other.define_operation("wait", "()", "Waits.", [](esl::operation) { CHECK(false); });
    try {
        other.eval("(wait)");
        CHECK(false);
    } catch (const esl::failure &thrown) {
        CHECK(thrown.status() == ESL_DIVERGED);
        CHECK(std::string(thrown.what()).find("the replay has diverged at record") != std::string::npos);
    }
    CHECK(cause_of([&] { other.run(); }) == ":DIVERGED");
    CHECK(cause_of([&] { other.poll(1000); }) == ":DIVERGED");
}

static void threads() {
    esl::engine engine(esl::settings{});
    engine.eval("(progn (define-input commands :capacity 9) (defun double (n) (* 2 n)))");
    esl::handle handle = engine.handle();
    std::thread operator_thread([handle]() mutable {
        int doubled = handle.call("double", {21}).wait().as<int>();
        handle.assert_fact(esl::value::read("(at rover ridge)")).wait();
        esl::value places = handle.query(esl::value::read("(at ?robot ?place)")).wait();
        CHECK(places[0].find("place")->text() == "RIDGE");
        handle.signal("commands", {doubled});
    });
    CHECK(engine.eval("(wait-for-event commands)").as<int>() == 42);
    operator_thread.join();
    CHECK(cause_of([&] { handle.signal("no-such-input"); }) == ":INVALID-ARGUMENT");
    esl::reply answer = engine.begin("(list 1)");
    CHECK(!answer.take());
    while (engine.poll(1000).state == ESL_RUNNING) {
    }
    CHECK(answer.take()->print() == "(1)");
}

int main() {
    values();
    functions();
    objects();
    tables();
    definitions();
    json();
    watching();
    operations();
    futures();
    divergence();
    threads();
    CHECK(cause_of([] { esl::settings s; s.allow = {"fly"}; esl::engine engine(s); }) == ":INVALID-ARGUMENT");
    try {
        esl::settings small;
        small.memory = 1000;
        esl::engine engine(small);
        CHECK(false);
    } catch (const esl::failure &thrown) {
        CHECK(std::string(thrown.what()).find("raise it by `esl_config_set_memory`") != std::string::npos);
    }
    std::cout << faults << " faults" << std::endl;
    return faults != 0;
}
