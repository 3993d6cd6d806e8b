%% world_echo: a server with a thousand connections, each of which asks twenty times and waits for the echo.
-module(world_echo).
-export([main/0]).

main() ->
    Options = [binary, {packet, line}, {active, false}, {nodelay, true}],
    {ok, Listener} = gen_tcp:listen(0, [{ip, {127, 0, 0, 1}}, {backlog, 1024} | Options]),
    {ok, Port} = inet:port(Listener),
    spawn_link(fun() -> accept(Listener) end),
    Main = self(),
    [spawn_link(fun() ->
        {ok, Socket} = gen_tcp:connect({127, 0, 0, 1}, Port, Options),
        Main ! {answers, ask(Socket, 0)}
    end) || _ <- lists:seq(1, 1000)],
    io:format("~b~n", [lists:sum([receive {answers, N} -> N end || _ <- lists:seq(1, 1000)])]).

ask(Socket, 20) -> gen_tcp:close(Socket), 20;
ask(Socket, N) ->
    ok = gen_tcp:send(Socket, <<"hello\n">>),
    {ok, <<"hello\n">>} = gen_tcp:recv(Socket, 0),
    ask(Socket, N + 1).

accept(Listener) ->
    {ok, Socket} = gen_tcp:accept(Listener),
    Server = spawn(fun() -> receive go -> echo(Socket) end end),
    ok = gen_tcp:controlling_process(Socket, Server),
    Server ! go,
    accept(Listener).

echo(Socket) ->
    case gen_tcp:recv(Socket, 0) of
        {ok, Line} -> ok = gen_tcp:send(Socket, Line), echo(Socket);
        {error, closed} -> gen_tcp:close(Socket)
    end.
