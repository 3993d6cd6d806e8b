%% Messages from one node to another: `facts:read()`, `facts:publish(Node, Count)`. The reader keeps each in a table, and
%% prints the seconds from the first to the last, and the bytes of the runtime; the publisher the seconds of sending.
-module(facts).
-export([read/0, publish/2]).

read() ->
    register(reader, self()),
    Table = ets:new(samples, [set]),
    receive {sample, Publisher, 0, Count} -> ok end,
    Begun = erlang:monotonic_time(),
    ets:insert(Table, {{Publisher, 0}}),
    take(Table, Publisher, Count - 1),
    show(Begun),
    io:format("~b~n", [erlang:memory(total)]),
    halt().

take(_, _, 0) -> ok;
take(Table, Publisher, Left) ->
    receive {sample, Publisher, Number, _} -> ets:insert(Table, {{Publisher, Number}}) end,
    take(Table, Publisher, Left - 1).

publish(Node, Count) ->
    await(Node),
    Begun = erlang:monotonic_time(),
    [{reader, Node} ! {sample, publisher, Number, Count} || Number <- lists:seq(0, Count - 1)],
    show(Begun),
    timer:sleep(5000),
    halt().

await(Node) ->
    case net_kernel:connect_node(Node) andalso rpc:call(Node, erlang, whereis, [reader]) of
        Reader when is_pid(Reader) -> ok;
        _ -> timer:sleep(50), await(Node)
    end.

show(Begun) ->
    Time = erlang:monotonic_time() - Begun,
    io:format("~.3f~n", [erlang:convert_time_unit(Time, native, microsecond) / 1000000]).
