%% task_ring: a thousand processes in a ring pass on a number, each adding one, a thousand times around.
-module(task_ring).
-export([main/0]).

main() ->
    First = build(1000, self()),
    io:format("~b~n", [turn(First, 1000, 0)]).

build(0, To) -> To;
build(N, To) -> build(N - 1, spawn(fun() -> link_to(To, 1000) end)).

link_to(_, 0) -> ok;
link_to(To, N) -> receive {token, Value} -> To ! {token, Value + 1} end, link_to(To, N - 1).

turn(_, 0, Value) -> Value;
turn(First, N, Value) -> First ! {token, Value}, receive {token, New} -> turn(First, N - 1, New) end.
