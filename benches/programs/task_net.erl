%% task_net: two processes run side by side and awaited, two hundred thousand times.
-module(task_net).
-export([main/0]).

main() -> io:format("~b~n", [nets(0, 200000, 0)]).

nets(N, N, Sum) -> Sum;
nets(I, N, Sum) ->
    {A, RefA} = spawn_monitor(fun() -> exit({value, I}) end),
    {B, RefB} = spawn_monitor(fun() -> exit({value, 1}) end),
    ValueA = receive {'DOWN', RefA, process, A, {value, VA}} -> VA end,
    ValueB = receive {'DOWN', RefB, process, B, {value, VB}} -> VB end,
    nets(I + 1, N, Sum + ValueA + ValueB).
