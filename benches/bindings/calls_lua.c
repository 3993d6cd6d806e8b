/* The same as calls_esl.c with Lua: `lua_pcall` of a function that calls a function of C; and states made with
 * their libraries and closed. */
#include <lauxlib.h>
#include <lua.h>
#include <lualib.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

static int increment(lua_State *lua) {
    lua_pushinteger(lua, luaL_checkinteger(lua, 1) + 1);
    return 1;
}

int main(int count, char **arguments) {
    long calls = count > 1 ? atol(arguments[1]) : 100000, states = count > 2 ? atol(arguments[2]) : 100;
    lua_State *lua = luaL_newstate();
    luaL_openlibs(lua);
    lua_register(lua, "increment", increment);
    if (luaL_dostring(lua, "function twice_more(n) return 1 + increment(n) end")) return 1;
    lua_Integer n = 0;
    double best = 1e18;
    for (int round = 0; round < 5; round++) {
        double start = now();
        for (long call = 0; call < calls; call++) {
            lua_getglobal(lua, "twice_more");
            lua_pushinteger(lua, n);
            if (lua_pcall(lua, 1, 1, 0)) return 1;
            n = lua_tointeger(lua, -1);
            lua_pop(lua, 1);
        }
        double time = (now() - start) / (double)calls;
        if (time < best) best = time;
    }
    if (n != 10 * calls) return 2;
    printf("%.1f\n", best);
    lua_close(lua);
    double start = now();
    for (long made = 0; made < states; made++) {
        lua = luaL_newstate();
        luaL_openlibs(lua);
        lua_close(lua);
    }
    printf("%.1f\n", (now() - start) / (double)states);
    return 0;
}
