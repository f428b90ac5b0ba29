# Lets `snakemake --cores 2` run here. `include` does not take over the default target, so `paper` names it again.
include: "workflow/Snakefile"


rule paper:
    default_target: True
    input:
        rules.all.input,
