%% Three philosophers take the left fork first: a deadlock.
-module(philosophers).
-export([run/0]).

run() ->
    Forks = list_to_tuple([spawn(fun() -> fork(2) end) || _ <- [1, 2, 3]]),
    [
        spawn(fun() -> dine(element(Left, Forks), element(Right, Forks)) end)
     || {Left, Right} <- [{1, 2}, {2, 3}, {3, 1}]
    ],
    ok.

%% A fork that is taken as many times.
fork(0) ->
    ok;
fork(Times) ->
    receive
        {take, Who} -> Who ! {taken, self()}
    end,
    receive
        release -> fork(Times - 1)
    end.

dine(Left, Right) ->
    take(Left),
    take(Right),
    Right ! release,
    Left ! release.

take(Fork) ->
    Fork ! {take, self()},
    receive
        {taken, Fork} -> ok
    end.
