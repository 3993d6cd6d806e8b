% Facts found by their first argument, which is unique, and by their second, which a hundred facts share.
:- dynamic fact/3.
fill :- forall(between(0, 99999, I), ( K is I mod 1000, assertz(fact(I, K, value)) )).
by_first(N, N, S, S) :- !.
by_first(I, N, S0, S) :-
    findall(K, fact(I, K, value), [K|_]), S1 is S0 + K, I1 is I + 1, by_first(I1, N, S1, S).
by_second(N, N, S, S) :- !.
by_second(K, N, S0, S) :-
    findall(I-V, fact(I, K, V), L), length(L, C), S1 is S0 + C, K1 is K + 1, by_second(K1, N, S1, S).
main :- fill, by_first(0, 100000, 0, A), print(A), nl, by_second(0, 1000, 0, B), print(B), nl.
:- initialization((main, halt)).
