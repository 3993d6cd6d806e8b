% Joins of two and three relations of fifty thousand facts each.
:- dynamic works_in/2, earns/2, likes/2, building/2.
fill :- forall(between(0, 49999, I),
               ( D is I mod 500, assertz(works_in(I, D)), E is (I*7) mod 1000, assertz(earns(I, E)),
                 L is (I*13) mod 50000, assertz(likes(I, L)) )),
        forall(between(0, 499, D), ( B is D mod 10, assertz(building(D, B)) )).
count(T, G) :- findall(T, G, L), length(L, N), print(N), nl.
main :- fill,
        count(P-D, ( works_in(P, D), building(D, 3) )),
        count([P,D,B], ( works_in(P, D), building(D, B) )),
        count([P,Q,E], ( likes(P, Q), earns(P, E), earns(Q, E) )),
        count([P,Q,D,E], ( likes(P, Q), works_in(P, D), works_in(Q, E) )).
:- initialization((main, halt)).
