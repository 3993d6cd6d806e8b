%% task_ping_pong: two processes that send each other a message a million times.
-module(task_ping_pong).
-export([main/0]).

main() ->
    Self = self(),
    Pid = spawn(fun() -> answer(Self, 1000000) end),
    io:format("~b~n", [ask(Pid, 1000000, 0)]).

answer(_, 0) -> ok;
answer(To, N) -> receive {ping, Value} -> To ! {pong, Value + 1} end, answer(To, N - 1).

ask(_, 0, Value) -> Value;
ask(Pid, N, Value) -> Pid ! {ping, Value}, receive {pong, New} -> ask(Pid, N - 1, New) end.
