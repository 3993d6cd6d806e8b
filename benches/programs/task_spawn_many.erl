%% task_spawn_many: a hundred thousand processes created, then all awaited.
-module(task_spawn_many).
-export([main/0]).

main() ->
    Refs = [element(2, spawn_monitor(fun() -> exit({value, I + 1}) end)) || I <- lists:seq(0, 99999)],
    io:format("~b~n", [lists:sum([receive {'DOWN', Ref, process, _, {value, V}} -> V end || Ref <- Refs])]).
