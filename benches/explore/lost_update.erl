%% Two processes increment a counter by a read and a write: one update can be lost.
-module(lost_update).
-export([run/0]).

run() ->
    Table = ets:new(counter, [public]),
    ets:insert(Table, {count, 0}),
    Main = self(),
    Increment = fun() ->
        [{count, Count}] = ets:lookup(Table, count),
        ets:insert(Table, {count, Count + 1}),
        Main ! done
    end,
    [spawn(Increment) || _ <- [1, 2]],
    [receive done -> ok end || _ <- [1, 2]],
    [{count, 2}] = ets:lookup(Table, count),
    ok.
