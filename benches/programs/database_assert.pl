% A million facts of three arguments.
:- dynamic fact/3.
% ESL's database is a set: it does not add a fact that it already contains.
add(I, K) :- ( fact(I, K, value) -> true ; assertz(fact(I, K, value)) ).
main :- forall(between(0, 999999, I), ( K is I mod 1000, add(I, K) )),
        findall(X-Y, fact(77, X, Y), L), length(L, N), print(N), nl.
:- initialization((main, halt)).
