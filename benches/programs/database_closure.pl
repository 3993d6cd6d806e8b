% The transitive closure of a cyclic graph of a thousand nodes.
:- dynamic edge/2.
:- table path/2.
path(X, Y) :- edge(X, Y).
path(X, Y) :- path(X, Z), edge(Z, Y).
fill :- forall(between(0, 999, I),
               ( A is (I+1) mod 1000, assertz(edge(I, A)),
                 B is (I*7) mod 1000, ( edge(I, B) -> true ; assertz(edge(I, B)) ) )).
main :- fill, findall(X-Y, path(X, Y), L), length(L, N), print(N), nl,
        abolish_all_tables, findall(Y, path(3, Y), M), length(M, K), print(K), nl.
:- initialization((main, halt)).
