datatype Action = Inspect | MoveNext
datatype Command = Command(a:Action, w:int) 
datatype RadiationLevel = red | orange | green 

method Agent(waypoints: seq<int>, currentpos:int, radstat:RadiationLevel, wheelsready:bool) returns (actions: seq<Command>)
requires currentpos >= 0 && currentpos <= 12; //13 waypoints to patrol
requires |waypoints| == 13;
requires forall i:int :: 0<=i<|waypoints| ==> waypoints[i] == i;
requires forall i:int :: 0<=i<|waypoints| ==> i in waypoints;
ensures (wheelsready) == false ==> actions ==[];//safety check: if the hardware is not ready then do nothing.
ensures forall i:int :: 0<=i<|waypoints| ==> (wheelsready && at(i) && inspected(i) && radstat != red && radstat != orange  ==> exists next:int :: 0<=next<|waypoints| && Command(MoveNext, next) in actions);
ensures forall i:int :: 0<=i<|waypoints| ==> (wheelsready && at(i) && (! inspected(i)) ==> Command(Inspect, i) in actions);
ensures wheelsready && (radstat == red || radstat == orange) ==> Command(MoveNext, 0) in actions;
{
    var time, next := 0, 0; 
    var current:=currentpos;
    actions := [];

    if(wheelsready){
        while(wheelsready && time <200)   
        invariant next in waypoints;
        invariant current in waypoints;
        invariant time > 0 && (radstat == red || radstat == orange) ==> Command(MoveNext, 0) in actions && next == 0;
        invariant time > 0 && at(current) && (! inspected(current)) ==> Command(Inspect, current) in actions;
        invariant time > 0 && at(old(current)) && inspected(old(current)) && radstat != red && radstat != orange ==> Command(MoveNext, next) in actions && current == old(next);
        {
            if(at(current) && inspected(current) && radstat != red && radstat != orange){
                next := getnextwaypoint(current);
                actions := actions + [Command(MoveNext, next)];
            }
            if(at(current) && (! inspected(current))){
                actions := actions + [Command(Inspect, current)];
            }
            if(radstat == red || radstat == orange){
                next := 0;
                actions := actions + [Command(MoveNext, next)];
            }
            time := time +20;
            current := next;
        }
    }
}
