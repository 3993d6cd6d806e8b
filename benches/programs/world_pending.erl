%% world_pending: a hundred thousand processes, each waiting for a message that does not come.
-module(world_pending).
-export([main/0]).

main() ->
    Main = self(),
    [spawn(fun() -> Main ! begun, receive never -> ok end end) || _ <- lists:seq(1, 100000)],
    [receive begun -> ok end || _ <- lists:seq(1, 100000)],
    io:format("~b~n", [100000]).
