%% task_abort_beside_sleepers: kills of an endless loop, while ten thousand others wake every 100 ms.
%% Reports the median of a hundred.
-module(task_abort_beside_sleepers).
-export([main/0]).

main() ->
    [spawn(fun() -> timer:sleep(I div 100), wake() end) || I <- lists:seq(0, 9999)],
    timer:sleep(200),
    Times = lists:sort([measure() || _ <- lists:seq(1, 100)]),
    io:format(standard_error, "measured ~b ns~n", [lists:nth(51, Times)]),
    io:format("done~n").

wake() -> receive after 100 -> wake() end.

endless() -> endless().

measure() ->
    {Victim, Ref} = spawn_monitor(fun endless/0),
    timer:sleep(3),
    Begin = erlang:monotonic_time(nanosecond),
    exit(Victim, kill),
    receive {'DOWN', Ref, process, Victim, _} -> erlang:monotonic_time(nanosecond) - Begin end.
