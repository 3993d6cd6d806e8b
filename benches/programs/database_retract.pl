% Half a million facts asserted and retracted one by one, and as many retracted at once.
:- dynamic state/2.
add(I, V) :- ( state(I, V) -> true ; assertz(state(I, V)) ).
fill :- forall(between(0, 499999, I), ( V is I mod 10, add(I, V) )).
drop(N, N, S, S) :- !.
drop(I, N, S0, S) :- V is I mod 10, retract(state(I, V)), S1 is S0 + 1, I1 is I + 1, drop(I1, N, S1, S).
main :- fill, drop(0, 500000, 0, A), print(A), nl,
        fill, aggregate_all(count, retract(state(_, _)), B), print(B), nl.
:- initialization((main, halt)).
