/* The second half of a cycle: one deed of the current intention. Part of agent.c. */

typedef struct { /* what a deed is for others */
    int action, to, letter; /* interned, or -1 */
} Told;

static void gw_done(Mind *m, Intention *x) {
    gw_tail(m, x);
    m->cur = gw_store(x);
}
static int gw_bound(int t, int at, int value) {
    int result = gw_arg(t, at);
    if (!gw_isvar(result)) gw_give_up("a result that is no free variable");
    return gw_unify(result, value);
}
/* Actions that compute bind their last argument */
static void gw_compute(int t) {
    int name = gw_functor(t), n = gw_arity(t);
    if (n >= 3 && (name == SUM || name == MINUS || name == TIMES || name == DIVIDE)) {
        double x, y;
        if (!gw_number(gw_arg(t, 0), &x) || !gw_number(gw_arg(t, 1), &y)) gw_give_up("no number to compute with");
        gw_bound(t, 2, gw_numeral(name == SUM ? x + y : name == MINUS ? x - y : name == TIMES ? x * y : x / y));
    } else if (n >= 3 && name == APPEND) {
        const char *a = gw_quoted(gw_arg(t, 0)), *b = gw_quoted(gw_arg(t, 1));
        if (!a || !b) gw_give_up("no text to append");
        char *text = gw_join("\"", a + 1, "");
        text[strlen(text) - 1] = 0;
        text = gw_longer(text, b + 1, "");
        text[strlen(text) - 1] = '"';
        gw_bound(t, 2, gw_atom(text));
        free(text);
    } else if (n >= 2 && name == TOSTRING) {
        int shown = gw_export(gw_arg(t, 0), 0);
        if (!gw_shown[shown].ground) gw_give_up("the text of a variable");
        char *text = gw_join("\"", gw_shown[shown].text, "\"");
        gw_bound(t, 1, gw_atom(text));
        free(text);
    }
}

static void gw_add_belief(Mind *m, Intention *x, int t) {
    int known = gw_believes(m, t, 0, 0), seen = x->f[0].plan == PERCEIVES;
    gw_undo(0);
    t = gw_export(t, 0);
    gw_add(m, t, seen);
    gw_done(m, x);
    gw_wake(m, t);
    if (!known) gw_put(m, gw_single(t, 0, 0, OPEN));
}

static void gw_drop_belief(Mind *m, Intention *x, int t) {
    int i, gone = 0, first = -1, event;
    t = gw_deref(t);
    event = gw_export(t, 0);
    for (i = 0; !gw_isvar(t) && i < m->nb;) {
        if (!gw_unifies(t, gw_import(m->bel[i], 0))) {
            i++;
            continue;
        }
        if (!gone++) first = m->bel[i];
        gw_rid(m, i);
    }
    if (gone) gw_unify(t, gw_import(first, 0));
    gw_done(m, x);
    gw_undo(0);
    gw_wake(m, event);
    while (gone--) gw_put(m, gw_single(event, 1, 0, OPEN));
}

static void gw_suspend(Mind *m, Intention *x) {
    int i, j, k;
    x->waiting = 1;
    m->cur = gw_store(x);
    if (!gw_sift(m)) {
        gw_put(m, m->cur);
        m->cur = NOBODY;
        m->asleep = 1;
    }
    k = gw_sift(m);
    for (i = k + 1; i < m->nq; i++) { /* those that wait are sorted by their weights */
        int it = m->q[i];
        for (j = i; j > k && gw_lighter(it, m->q[j - 1]); j--) m->q[j] = m->q[j - 1];
        m->q[j] = it;
    }
}
static void gw_wait(Mind *m, Intention *x, int t, int not) {
    int met = gw_believes(m, t, 0, 0);
    if (not) gw_undo(0);
    if (met != not)
        gw_done(m, x);
    else
        gw_suspend(m, x);
}

/* Whether a frame is about the goal */
static int gw_fits(const Frame *f, int t) {
    return f->isgoal && gw_unifies(f->event, t);
}
/* An achieve goal that is believed already leaves the goal base, unless another intention is at it; one that is wanted
   already is left to who is at it. */
static int gw_achieved(Mind *m, Intention *x, int t) {
    Intention y;
    int i, k, elsewhere = 0, exact = gw_export(t, 0);
    if (gw_believes(m, t, 0, 0)) {
        gw_done(m, x);
        gw_undo(0);
        for (i = 0; i < m->nq; i++) {
            gw_load(&y, m->q[i]);
            for (k = 0; k < y.n; k++) elsewhere |= gw_fits(&y.f[k], gw_import(exact, 0));
        }
        if (!elsewhere) gw_unwant(m, exact, 1);
        return 1;
    }
    for (i = 0; i < m->ng; i++)
        if (m->goal[i] % 2 && gw_unify(t, gw_import(m->goal[i] / 2, 0))) {
            gw_done(m, x);
            return 1;
        } else
            gw_undo(0);
    return 0;
}
static void gw_add_goal(Mind *m, Intention *x, int t, int kind) {
    Frame *f = &x->f[x->n - 1];
    if (gw_isvar(gw_deref(t))) gw_give_up("a goal that is no more than a variable");
    if (kind && gw_achieved(m, x, t)) return;
    gw_want(m, gw_export(t, 0), kind);
    f->fresh = 0;
    if (!kind) {
        f->at++;
        f->null = 1;
    }
    gw_push(x, t, 0, 1, kind, OPEN);
    m->cur = gw_store(x);
}

/* Cut off what stands on the goal, and the deed that posted it; where only its kind or sign differs, that deed alone.
   Whether it was there at all. */
static int gw_cut(Mind *m, Intention *x, int t, int kind) {
    int i, exact = -1, loose = 0;
    for (i = x->n - 1; i >= 0; i--)
        if (gw_fits(&x->f[i], t)) {
            loose = 1;
            if (!x->f[i].drop && x->f[i].kind == kind) exact = i;
        }
    if (!loose) return 0;
    if (exact >= 0) x->n = exact;
    return 1;
}
static int gw_posts(Frame *f, int t) { /* whether its next deed posts the goal */
    if (f->null) return 0;
    if (f->plan == STARTS) return !f->at && gw_unifies(f->event, t);
    return f->plan >= 0 && plans[f->plan].deeds[f->at].what == ADDGOAL && gw_unifies(gw_deed_term(f), t);
}
static int gw_goals(const Intention *x, int *goals) { /* twice the terms' numbers, and the kinds */
    int i, n = 0;
    for (i = 0; i < x->n; i++)
        if (x->f[i].isgoal) goals[n++] = 2 * gw_export(x->f[i].event, 0) + x->f[i].kind;
    return n;
}
static void gw_drop_goal(Mind *m, Intention *x, int t, int kind) {
    int i, j, n, lost[MAXFRAMES], nlost = 0, goals[MAXFRAMES], exact = gw_export(t, 0);
    Intention y;
    gw_unwant(m, exact, kind);
    n = gw_goals(x, goals);
    if (gw_cut(m, x, t, kind)) {
        memcpy(lost, goals, sizeof lost);
        nlost = n;
    } else
        for (j = 0; j < m->nq;) {
            gw_load(&y, m->q[j]);
            n = gw_goals(&y, goals);
            if (gw_cut(m, &y, gw_import(exact, 0), kind)) {
                memcpy(lost, goals, sizeof lost);
                nlost = n;
                y.waiting = 0;
                gw_tail(m, &y);
                m->q[j] = gw_store(&y);
            } else if (!kind && gw_posts(&y.f[y.n - 1], gw_import(exact, 0))) {
                gw_tail(m, &y);
                m->q[j] = gw_store(&y);
            }
            if (m->q[j] == NOBODY)
                gw_take(m, j);
            else
                j++;
        }
    gw_done(m, x);
    for (i = 0; i < nlost; i++) gw_unwant(m, lost[i] / 2, lost[i] % 2);
}

static void gw_send(Mind *m, Intention *x, int t, Told *told) {
    int me = progname(m->of), message = gw_node(SENT, 4), letter = gw_node(RECEIVED, 4), action = gw_node(SEND, 2);
    int to = gw_export(gw_inner(gw_arg(t, 0)), 0), i, sent;
    for (i = 1; i < 3; i++) {
        int part = gw_arg(t, i);
        NODE(message).args[i + 1] = NODE(letter).args[i + 1] = part;
    }
    NODE(message).args[0] = gw_import(to, 0);
    NODE(letter).args[1] = gw_import(to, 0);
    NODE(message).args[1] = NODE(letter).args[0] = me;
    NODE(action).args[0] = gw_arg(t, 2);
    NODE(action).args[1] = gw_arg(t, 0);
    sent = gw_export(message, 0);
    told->action = gw_export(action, 0);
    told->to = to;
    told->letter = gw_single(gw_export(letter, 0), 0, 0, OPEN);
    gw_add(m, sent, 0);
    gw_done(m, x);
    gw_put(m, gw_single(sent, 0, 0, OPEN));
}

/* Does the next deed. An intention without a plan, for which none will come, has none. */
static Told gw_deed(Mind *m) {
    Told told = {-1, -1, -1};
    Intention x;
    Frame *f;
    int what, t;
    gw_top = gw_ntrail = 0;
    gw_load(&x, m->cur);
    f = &x.f[x.n - 1];
    m->planned = 0;
    if (f->plan == OPEN) return told;
    if (f->null) {
        gw_done(m, &x);
        return told;
    }
    what = f->plan == STARTS ? ADDGOAL : f->plan == PERCEIVES ? f->drop ? DROPBEL : ADDBEL : plans[f->plan].deeds[f->at].what;
    if (what == LOCKS || what == UNLOCKS) {
        x.locked = what == LOCKS;
        gw_done(m, &x);
        return told;
    }
    t = f->plan < 0 ? f->event : gw_deed_term(f);
    if (what != ADDGOAL && what != DROPGOAL) t = gw_deref(gw_computed(t));
    if ((what == ADDBEL || what == ACT) && gw_isvar(t)) t = gw_atom("_");
    switch (what) {
    case ADDBEL: gw_add_belief(m, &x, t); break;
    case DROPBEL: gw_drop_belief(m, &x, t); break;
    case WAITS:
    case WAITSNOT: gw_wait(m, &x, t, what == WAITSNOT); break;
    case ADDGOAL: gw_add_goal(m, &x, t, f->plan == STARTS ? f->kind : plans[f->plan].deeds[f->at].kind); break;
    case DROPGOAL: gw_drop_goal(m, &x, t, plans[f->plan].deeds[f->at].kind); break;
    case SENDS: gw_send(m, &x, t, &told); break;
    default:
        told.action = gw_export(t, 0);
        gw_compute(t);
        gw_done(m, &x);
    }
    return told;
}
