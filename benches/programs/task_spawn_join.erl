%% task_spawn_join: a million processes, one after another, each created and awaited.
-module(task_spawn_join).
-export([main/0]).

main() -> io:format("~b~n", [work(0, 1000000, 0)]).

work(N, N, Sum) -> Sum;
work(I, N, Sum) ->
    {Pid, Ref} = spawn_monitor(fun() -> exit({value, I}) end),
    receive {'DOWN', Ref, process, Pid, {value, Value}} -> work(I + 1, N, Sum + Value) end.
