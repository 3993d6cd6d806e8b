%% world_lines: a million short messages, lines over a connection of the loopback.
-module(world_lines).
-export([main/0]).

main() ->
    {ok, Listener} = gen_tcp:listen(0, [binary, {packet, line}, {active, true}, {ip, {127, 0, 0, 1}}]),
    {ok, Port} = inet:port(Listener),
    spawn_link(fun() ->
        {ok, Socket} = gen_tcp:connect({127, 0, 0, 1}, Port, [binary]),
        Batch = binary:copy(<<"message\n">>, 100),
        [ok = gen_tcp:send(Socket, Batch) || _ <- lists:seq(1, 10000)],
        gen_tcp:close(Socket)
    end),
    {ok, Socket} = gen_tcp:accept(Listener),
    io:format("~b~n", [count(Socket, 0)]).

count(Socket, N) ->
    receive
        {tcp, Socket, _} -> count(Socket, N + 1);
        {tcp_closed, Socket} -> N
    end.
