// Runs each script, one after the other: for each a thread, which ends with its script, or is ended.
import java.nio.file.*;

public class AvowRuns {
    public static void main(String[] arguments) throws Exception {
        for (int run = 1; run < arguments.length; run++) {
            Files.copy(Paths.get(arguments[run]), Paths.get("script.txt"), StandardCopyOption.REPLACE_EXISTING);
            System.out.println("avow: run " + arguments[run]);
            Thread agents = new Thread(() -> ail.mas.AIL.runAIL("agent.ail"));
            agents.setDaemon(true);
            agents.start();
            agents.join(Long.parseLong(arguments[0]));
            while (agents.isAlive()) {
                agents.stop();
                agents.join(100);
            }
        }
        System.exit(0);
    }
}
