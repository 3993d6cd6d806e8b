%% task_abort_beside_loops: kills of an endless loop, while ten thousand others loop endlessly too.
%% Reports the median of five.
-module(task_abort_beside_loops).
-export([main/0]).

main() ->
    [spawn(fun endless/0) || _ <- lists:seq(0, 9999)],
    % The measuring process must not wait for its turn.
    process_flag(priority, high),
    Times = lists:sort([measure() || _ <- lists:seq(1, 5)]),
    io:format(standard_error, "measured ~b ns~n", [lists:nth(3, Times)]),
    io:format("done~n").

endless() -> endless().

measure() ->
    {Victim, Ref} = spawn_monitor(fun endless/0),
    Begin = erlang:monotonic_time(nanosecond),
    exit(Victim, kill),
    receive {'DOWN', Ref, process, Victim, _} -> erlang:monotonic_time(nanosecond) - Begin end.
