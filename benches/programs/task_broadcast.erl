%% task_broadcast: a message to each of ten thousand processes that wait for it, a hundred times.
-module(task_broadcast).
-export([main/0]).

main() ->
    Counter = counters:new(1, []),
    Self = self(),
    Pids = [spawn(fun() -> waiter(Self, Counter, 100) end) || _ <- lists:seq(1, 10000)],
    turn(Pids, 100),
    [receive done -> ok end || _ <- Pids],
    io:format("~b~n", [counters:get(Counter, 1)]).

waiter(Parent, _, 0) -> Parent ! done;
waiter(Parent, Counter, N) -> receive go -> counters:add(Counter, 1, 1) end, waiter(Parent, Counter, N - 1).

turn(_, 0) -> ok;
turn(Pids, N) -> [Pid ! go || Pid <- Pids], erlang:yield(), turn(Pids, N - 1).
