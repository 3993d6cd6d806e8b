%% The reaction of a process: see reaction.esl.
-module(reaction).
-export([main/1]).

main([Cause, Beside, Samples | Port]) ->
    Count = list_to_integer(Samples),
    Self = self(),
    spawn(fun() ->
        process_flag(priority, high),
        timer:sleep(2000),
        Delays = case Cause of
            "timer" -> timer_delays(Count);
            "input" -> input_delays(Count, list_to_integer(hd(Port)))
        end,
        Self ! {delays, Delays}
    end),
    load(Beside),
    receive {delays, Delays} -> [io:format("~b~n", [Delay]) || Delay <- Delays] end,
    halt(0).

timer_delays(Count) ->
    timer_delays(Count, erlang:monotonic_time(millisecond) + 100, []).

timer_delays(0, _, Delays) -> Delays;
timer_delays(Count, Next, Delays) ->
    erlang:start_timer(Next, self(), tick, [{abs, true}]),
    receive {timeout, _, tick} -> ok end,
    Late = erlang:monotonic_time(nanosecond) - Next * 1000000,
    timer_delays(Count - 1, Next + 1 + max(Late, 0) div 1000000, [Late | Delays]).

input_delays(Count, Port) ->
    {ok, Socket} = gen_udp:open(Port, [binary, {ip, {127, 0, 0, 1}}, {active, true}]),
    input_delays(Count, Socket, []).

input_delays(0, _, Delays) -> Delays;
input_delays(Count, Socket, Delays) ->
    receive {udp, Socket, _, _, Data} ->
        Late = os:system_time(nanosecond) - binary_to_integer(Data),
        input_delays(Count - 1, Socket, [Late | Delays])
    end.

load("idle") -> ok;
load("compute") -> [spawn(fun compute/0) || _ <- lists:seq(1, 10)];
load("allocate") ->
    spawn(fun() ->
        Live = [lists:duplicate(6250, nil) || _ <- lists:seq(1, 1000)],
        allocate(Live, erlang:monotonic_time(microsecond), 0)
    end);
load("compile") -> spawn(fun() -> compile(0) end);
load("tasks") -> [spawn(fun sleeper/0) || _ <- lists:seq(1, 100000)].

fibonacci(N) when N < 2 -> N;
fibonacci(N) -> fibonacci(N - 1) + fibonacci(N - 2).

%% A tenth of the time.
compute() ->
    compute(erlang:monotonic_time(microsecond) + 4000),
    timer:sleep(46),
    compute().

compute(End) ->
    fibonacci(15),
    case erlang:monotonic_time(microsecond) < End of
        true -> compute(End);
        false -> ok
    end.

%% At most 1 GB a second.
allocate(Live, Begin, Bytes) ->
    [lists:duplicate(1000, nil) || _ <- lists:seq(1, 64)],
    More = Bytes + 1024000,
    case More div 1000 - (erlang:monotonic_time(microsecond) - Begin) of
        Ahead when Ahead > 1000 -> timer:sleep(Ahead div 1000);
        _ -> ok
    end,
    allocate(Live, Begin, More).

%% Four fifths of the time.
compile(N) ->
    Begin = erlang:monotonic_time(millisecond),
    Module = list_to_atom("hot_" ++ integer_to_list(N rem 100)),
    Forms = [{attribute, 1, module, Module},
             {attribute, 2, export, [{f, 1}]},
             {function, 3, f, 1,
              [{clause, 3, [{var, 3, 'X'}], [], [{op, 3, '+', {var, 3, 'X'}, {integer, 3, N}}]}]}],
    {ok, Module, Code} = compile:forms(Forms),
    code:purge(Module),
    {module, Module} = code:load_binary(Module, "none", Code),
    Module:f(1),
    timer:sleep((erlang:monotonic_time(millisecond) - Begin) div 4),
    compile(N + 1).

sleeper() -> timer:sleep(1000 + rand:uniform(9000)), sleeper().
