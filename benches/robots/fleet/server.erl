%% Round trips of gen_server:call between two nodes: `server:serve()`, `server:measure(Node, Count)`.
-module(server).
-behaviour(gen_server).
-export([serve/0, measure/2, init/1, handle_call/3, handle_cast/2]).

serve() ->
    {ok, _} = gen_server:start({local, server}, ?MODULE, [], []),
    receive stop -> ok end.

init([]) -> {ok, none}.
handle_call({add, A, B}, _From, State) -> {reply, A + B, State}.
handle_cast(_, State) -> {noreply, State}.

measure(Node, Count) ->
    await(Node),
    times(Node, 300),
    Sorted = lists:sort(times(Node, Count)),
    io:format("~.1f ~.1f ~.1f~n", [lists:sum(Sorted) / Count, nth(Count div 2, Sorted), nth(99 * Count div 100, Sorted)]),
    halt().

await(Node) ->
    case net_kernel:connect_node(Node) andalso rpc:call(Node, erlang, whereis, [server]) of
        Server when is_pid(Server) -> ok;
        _ -> timer:sleep(50), await(Node)
    end.

nth(Index, Times) -> lists:nth(Index + 1, Times) / 1.

times(Node, Count) -> [trip(Node) || _ <- lists:seq(1, Count)].

trip(Node) ->
    Begun = erlang:monotonic_time(nanosecond),
    3 = gen_server:call({server, Node}, {add, 1, 2}),
    (erlang:monotonic_time(nanosecond) - Begun) / 1000.
