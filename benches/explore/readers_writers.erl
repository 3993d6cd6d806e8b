%% Two readers and a writer share a value, and the first process lets them in: never a reader beside the writer.
-module(readers_writers).
-export([run/0]).

run() ->
    Table = ets:new(shared, [public]),
    ets:insert(Table, [{value, 0}, {writing, false}, {readers, 0}]),
    Server = self(),
    [spawn(fun() -> read(Server, Table) end) || _ <- [1, 2]],
    spawn(fun() -> write(Server, Table) end),
    serve(0, false, 3).

%% Lets as many readers and writers in as are still to come.
serve(0, false, 0) ->
    ok;
serve(Readers, IsWriting, Left) ->
    receive
        {read, Who} when not IsWriting ->
            Who ! go_on,
            serve(Readers + 1, IsWriting, Left - 1);
        {write, Who} when not IsWriting, Readers =:= 0 ->
            Who ! go_on,
            serve(Readers, true, Left - 1);
        has_read ->
            serve(Readers - 1, IsWriting, Left);
        has_written ->
            serve(Readers, false, Left)
    end.

enter(Server, How) ->
    Server ! {How, self()},
    receive
        go_on -> ok
    end.

read(Server, Table) ->
    enter(Server, read),
    ets:update_counter(Table, readers, 1),
    [{writing, false}] = ets:lookup(Table, writing),
    ets:lookup(Table, value),
    ets:update_counter(Table, readers, -1),
    Server ! has_read.

write(Server, Table) ->
    enter(Server, write),
    ets:insert(Table, {writing, true}),
    [{readers, 0}] = ets:lookup(Table, readers),
    ets:insert(Table, {value, 1}),
    ets:insert(Table, {writing, false}),
    Server ! has_written.
