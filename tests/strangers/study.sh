# A thousand simulations: how the loop of a damper misses its test where three of its numbers are wrong.
hysim example damper.csv --device damper
hysim identify damper.csv --model bouc-wen --fix n=1.5 --every 4 --out law.json
cat > study.toml <<'END'
seed = 1
[response]
law = "law.json"
record = "damper.csv"
[sample]
method = "latin_hypercube"
n = 1000
distributions.beta = [0.2, 0.5]
distributions.gamma = [0.0, 0.3]
distributions.gain = [15.0, 21.0]
END
hysim sweep study.toml --out rows.sqlite --csv rows.csv --plot rows.svg
hysim sweep --show rows.sqlite --json
