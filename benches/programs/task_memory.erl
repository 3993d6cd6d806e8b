%% task_memory: a million processes that wait at the same time, then end.
-module(task_memory).
-export([main/0]).

main() ->
    Pids = [spawn_monitor(fun() -> receive Value -> exit({value, Value}) end end)
            || _ <- lists:seq(1, 1000000)],
    [Pid ! 1 || {Pid, _} <- Pids],
    io:format("~b~n", [lists:foldl(fun collect/2, 0, Pids)]).

collect({_, Ref}, Sum) -> receive {'DOWN', Ref, process, _, {value, Value}} -> Sum + Value end.
