/* Beliefs, goals, and what is derived of them by rules: the first way to meet conditions stays bound. Part of agent.c. */

typedef struct {
    int nb, ng, nq, cur, planned, fresh, asleep;
    int bel[MAXBEL], seen[MAXBEL], goal[MAXGOALS], q[MAXQUEUE];
    const Agent *of;
} Mind;

typedef struct Rest { /* conditions that are left */
    const Cond *c;
    int n, *env, depth;
    const struct Rest *next;
} Rest;

static int gw_solve(const Mind *m, const Cond *c, int n, int *env, int depth, const Rest *rest);
static int gw_believes(const Mind *m, int goal, int depth, const Rest *rest);

static int gw_goes_on(const Mind *m, const Rest *rest) {
    return !rest || gw_solve(m, rest->c, rest->n, rest->env, rest->depth, rest->next);
}
/* A rule with a cut derives nothing in AIL; if what stands before its last condition holds, no other rule is tried.
   What was found before a cut stands, and so does the first way to meet each condition after it. */
static int gw_cuts(const Mind *m, const Rule *r, int *env, int depth) {
    int i, cut;
    for (cut = 0; cut < r->n - 1 && r->body[cut].what != CUT; cut++);
    if (!gw_solve(m, r->body, cut, env, depth, 0)) return 0;
    for (i = cut; i < r->n - 1; i++)
        if (r->body[i].what != CUT && !gw_solve(m, r->body + i, 1, env, depth, 0)) return 0;
    return 1;
}
static int gw_by_rule(const Mind *m, const Rule *r, int goal, int depth, const Rest *rest, int *committed) {
    int env[MAXVARS], i, cuts = 0;
    gw_unbound(env);
    if (!gw_unify(goal, gw_build(r->head, env))) return 0;
    for (i = 0; i < r->n; i++) cuts |= r->body[i].what == CUT;
    if (!cuts) return gw_solve(m, r->body, r->n, env, depth + 1, rest);
    if (r->n == 1) return gw_goes_on(m, rest);
    *committed = gw_cuts(m, r, env, depth + 1);
    return 0;
}
static int gw_believes(const Mind *m, int goal, int depth, const Rest *rest) {
    int i, trail = gw_ntrail, committed = 0;
    goal = gw_deref(goal);
    for (i = 0; i < m->nb; i++) {
        if (gw_isvar(goal) ? gw_functor(m->bel[i]) == SENT : gw_functor(m->bel[i]) != gw_functor(goal)) continue;
        if (gw_unify(goal, gw_import(m->bel[i], 0)) && gw_goes_on(m, rest)) return 1;
        gw_undo(trail);
    }
    if (gw_isvar(goal)) return 0;
    for (i = 0; i < m->of->nrules; i++) {
        const Rule *r = &m->of->rules[i];
        if (pats[r->head].functor != gw_functor(goal) || pats[r->head].n != gw_arity(goal)) continue;
        if (depth >= MAXDEPTH) gw_give_up("rules without end");
        if (gw_by_rule(m, r, goal, depth, rest, &committed)) return 1;
        gw_undo(trail);
        if (committed) return 0;
    }
    return 0;
}
static int gw_compare(const Mind *m, const Cond *c, int t, const Rest *rest) {
    double x, y;
    int left = gw_arg(t, 0), right = gw_arg(t, 1), l = gw_value(left, &x), r = gw_value(right, &y);
    if (l && r) return (c->what == LESS ? x < y : x == y) && gw_goes_on(m, rest);
    if (c->what == SAME && gw_isvar(left) && r) return gw_unify(left, gw_numeral(y)) && gw_goes_on(m, rest);
    if (c->what == SAME && gw_isvar(right) && l) return gw_unify(right, gw_numeral(x)) && gw_goes_on(m, rest);
    return 0;
}
/* A variable for an agent's name comes to be a text */
static int gw_told(int wanted, int name) {
    char *text;
    int found;
    wanted = gw_export(wanted, 0);
    if (gw_shown[wanted].ground && !gw_quoted(wanted)) return name;
    text = gw_join("\"", gw_shown[gw_export(name, 0)].text, "\"");
    found = gw_atom(text);
    free(text);
    return found;
}
static int gw_sent(const Mind *m, int t, const Rest *rest) {
    int i, trail = gw_ntrail;
    for (i = 0; i < m->nb; i++) {
        int b = m->bel[i];
        if (gw_functor(b) != SENT || gw_arity(b) != 4) continue;
        b = gw_import(b, 0);
        int to = gw_told(gw_arg(t, 0), gw_arg(b, 0)), from = gw_told(gw_arg(t, 1), gw_arg(b, 1));
        if (gw_unify(gw_arg(t, 0), to) && gw_unify(gw_arg(t, 1), from) && gw_unify(gw_arg(t, 2), gw_arg(b, 2)) &&
            gw_unify(gw_arg(t, 3), gw_arg(b, 3)) && gw_goes_on(m, rest))
            return 1;
        gw_undo(trail);
    }
    return 0;
}
static int gw_wanted(const Mind *m, int t, int kind, const Rest *rest) {
    int i, trail = gw_ntrail;
    for (i = 0; i < m->ng; i++) {
        if ((kind < 0 || m->goal[i] % 2 == kind) && gw_unify(t, gw_import(m->goal[i] / 2, 0)) && gw_goes_on(m, rest))
            return 1;
        gw_undo(trail);
    }
    return 0;
}
static int gw_meets(const Mind *m, const Cond *c, int *env, int depth, const Rest *rest) {
    int t;
    if (c->what == CUT) return gw_goes_on(m, rest);
    if (c->what == GROUP) return gw_solve(m, c->group, c->n, env, depth, rest);
    t = gw_build(c->pat, env);
    switch (c->what) {
    case BELIEF: return gw_believes(m, t, depth, rest);
    case GOAL: return gw_wanted(m, t, c->kind, rest);
    case TOLD: return gw_sent(m, t, rest);
    default: return gw_compare(m, c, t, rest);
    }
}
static int gw_solve(const Mind *m, const Cond *c, int n, int *env, int depth, const Rest *rest) {
    Rest more = {c + 1, n - 1, env, depth, rest};
    int trail = gw_ntrail, met;
    if (!n) return gw_goes_on(m, rest);
    if (c->positive) {
        if (gw_meets(m, c, env, depth, &more)) return 1;
        gw_undo(trail);
        return 0;
    }
    met = gw_meets(m, c, env, depth, 0);
    gw_undo(trail);
    return !met && gw_goes_on(m, &more);
}
