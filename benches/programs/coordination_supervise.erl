%% coordination_supervise: a supervisor restarts a child that fails, 100,000 times.
-module(coordination_supervise).
-behaviour(supervisor).
-export([main/0, init/1, begin_child/2]).

main() ->
    logger:set_primary_config(level, none),
    process_flag(trap_exit, true),
    Left = counters:new(1, []),
    counters:put(Left, 1, 100000),
    {ok, _} = supervisor:start_link(?MODULE, {Left, self()}),
    receive done -> io:format("~b~n", [counters:get(Left, 1)]) end.

init({Left, Main}) ->
    Flags = #{strategy => one_for_one, intensity => 100000, period => 1},
    Child = #{id => child, start => {?MODULE, begin_child, [Left, Main]}, restart => transient},
    {ok, {Flags, [Child]}}.

begin_child(Left, Main) -> {ok, spawn_link(fun() -> work(Left, Main) end)}.

work(Left, Main) ->
    case counters:get(Left, 1) of
        0 -> Main ! done;
        _ -> counters:sub(Left, 1, 1), exit(lost)
    end.
