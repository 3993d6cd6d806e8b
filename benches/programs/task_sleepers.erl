%% task_sleepers: a hundred thousand processes that sleep for a moment, ten times.
-module(task_sleepers).
-export([main/0]).

main() ->
    Refs = [element(2, spawn_monitor(fun() -> sleeper(1 + (I rem 100) div 10, 10) end))
            || I <- lists:seq(0, 99999)],
    [receive {'DOWN', Ref, process, _, _} -> ok end || Ref <- Refs],
    io:format("~b~n", [length(Refs)]).

sleeper(_, 0) -> ok;
sleeper(Milliseconds, N) -> receive after Milliseconds -> sleeper(Milliseconds, N - 1) end.
