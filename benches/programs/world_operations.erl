%% world_operations: a hundred thousand calls of another process that answers at once.
-module(world_operations).
-export([main/0]).

main() ->
    Server = spawn_link(fun serve/0),
    io:format("~b~n", [ask(Server, 0)]).

ask(_, 100000) -> 100000;
ask(Server, N) ->
    Server ! {self(), N},
    receive {Server, N} -> ask(Server, N + 1) end.

serve() -> receive {From, N} -> From ! {self(), N}, serve() end.
